"""`golem drivers lidar`: a Livox MID-360 on a domain."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field, replace

from tyro.conf import OmitArgPrefixes, Positional

from golem.hardware.drivers.mid360_driver import IMU_PORT, POINT_PORT, Mid360
from golem.interfaces.lidar import LidarScan
from golem.interfaces.livox import lidar_imu, scan_cloud
from golem.middleware.dds.base import Participant
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.middleware.ros.node import RosNode
from golem.runtime.live.clock import Every
from golem.runtime.live.node_setup import AsyncLogger, log_line, member
from golem.runtime.live.robot_time import RobotTime
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import TICK

CLOUD, IMU = "/livox/pointcloud", "/livox/imu"
SILENT = 0.5
"""Time without a scan after which the LiDAR counts as silent [s]: five scans."""
REPORT = 10.0
"""Time between two reports of what was lost [s]."""


@dataclass(frozen=True)
class LidarConfig:
    """Publish points and IMU of a MID-360 until Ctrl-C. Tell it our address with the vendor's tool first."""

    host: Positional[str]
    """Our address on the LiDAR's network, e.g. 192.168.1.50."""
    device: str | None = None
    """Address of the LiDAR; without it the first one that is heard."""
    point_port: int = POINT_PORT
    """Our port for points."""
    imu_port: int = IMU_PORT
    """Our port for the IMU."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class LidarProcess:
    """The LiDAR without its loop. Silence is told, and what was lost, and nothing else."""

    def __init__(
        self,
        participant: Participant,
        node: RosNode,
        lidar: Mid360,
        clock: Callable[[], float] = time.monotonic,
        tell: Callable[[str], None] = log_line,
    ) -> None:
        """Publish what `lidar` measures, stamped with the robot's time.

        Args:
            participant: member of the domain.
            node: its ROS node.
            lidar: the driver.
            clock: this process's own [s].
            tell: says a line to a person.
        """
        self._lidar, self._clock, self._tell = lidar, clock, tell
        self._robot_time = RobotTime(node, clock)
        self._endpoints = RoleEndpoints("robot", participant, node, (CLOUD, IMU))
        self._heard, self._silent = clock(), False
        self._reports, self._lost = Every(REPORT), (0, 0)

    def step(self) -> None:
        """Take what has come and send it."""
        now = self._clock()
        self._endpoints.step(now)
        for measured in self._lidar.step(now):
            if isinstance(measured, LidarScan):
                self._heard = now
            t = self._robot_time.at(measured.t)
            if t is None or math.isnan(t):
                continue
            if isinstance(measured, LidarScan):
                self._endpoints.send(CLOUD, replace(measured, t=t), scan_cloud)
            else:
                self._endpoints.send(IMU, replace(measured, t=t), lidar_imu)
        self._report(now)

    def _report(self, now: float) -> None:
        silent = now - self._heard > SILENT
        if silent != self._silent:
            self._silent = silent
            self._tell("The LiDAR is silent." if silent else "The LiDAR is heard.")
        lost = (self._lidar.lost, self._lidar.malformed)
        if self._reports.due(now) and lost != self._lost:
            points, malformed = (new - old for new, old in zip(lost, self._lost, strict=True))
            self._lost = lost
            self._tell(f"Lost {points} points; {malformed} datagrams are none of a MID-360.")


def run_lidar(config: LidarConfig) -> None:
    """Publish until Ctrl-C.

    Raises:
        LidarError: a port cannot be opened.
        DdsError: the domain cannot be joined.
    """
    with (
        interrupted() as stop,
        closing(AsyncLogger()) as tell,
        closing(Mid360(config.host, config.device, config.point_port, config.imu_port)) as lidar,
        member("lidar", config.dds, tell) as (participant, node),
    ):
        process = LidarProcess(participant, node, lidar, tell=tell)
        tell(f"The LiDAR that sends to {config.host} is on {config.dds}. Ctrl-C ends its driver.")
        while not stop.wait(TICK):
            process.step()
