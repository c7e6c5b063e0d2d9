"""`golem drivers camera`: one RealSense camera on a domain, in the place of one of the twin's."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal, Protocol

from tyro.conf import OmitArgPrefixes, Positional

from golem.hardware.drivers.realsense_camera import RealSense, device_frames
from golem.interfaces import public
from golem.interfaces.payloads import Exposure
from golem.middleware.dds.base import Participant
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.middleware.ros.node import RosNode
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.live.node_setup import AsyncLogger, log_line, member
from golem.runtime.live.robot_time import RobotTime
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import TICK


@dataclass(frozen=True)
class CameraConfig:
    """Publish the images of one RealSense camera until Ctrl-C."""

    camera: Positional[Literal["head", "left_hand", "right_hand"]]
    """Which of the robot's cameras it is."""
    serial: Positional[str]
    """Its serial number, or a recording (.bag, .db3)."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class ExposureSource(Protocol):
    """What images come from."""

    @property
    def fault(self) -> str:
        """Why there are none; empty while they come."""
        ...

    def step(self) -> Exposure | None:
        """Return a new one."""
        ...


class CameraProcess:
    """One camera without its loop."""

    def __init__(
        self,
        participant: Participant,
        node: RosNode,
        name: str,
        source: ExposureSource,
        clock: Callable[[], float],
        tell: Callable[[str], None] = log_line,
    ) -> None:
        """Publish what `source` sees as the images of the camera called `name`, stamped with the robot's time.

        Args:
            participant: member of the domain.
            node: its ROS node.
            name: which of the robot's cameras.
            source: its driver.
            clock: this process's own [s], in which the driver stamps.
            tell: says a line to a person.
        """
        self._name, self._source, self._clock, self._tell = name, source, clock, tell
        self._robot_time = RobotTime(node, clock)
        self._topics = [public.image(name, what) for what in public.IMAGES]
        self._endpoints = RoleEndpoints("robot", participant, node, self._topics)
        self._fault = ""

    def step(self) -> None:
        """Take what has come and send it to whoever listens."""
        self._endpoints.step(self._clock())
        exposure = self._source.step()
        if self._source.fault != self._fault:
            self._fault = self._source.fault
            self._tell(f"{self._name} camera: {self._fault or 'it works again.'}")
        t = None if exposure is None else self._robot_time.at(exposure.t)
        if exposure is None or t is None:
            return
        for topic in self._topics:
            self._endpoints.send(topic, replace(exposure, t=t))


def run_camera(config: CameraConfig) -> None:
    """Publish until Ctrl-C.

    Raises:
        CameraError: the camera cannot be started.
        MissingExtra, MissingSystemLibrary: pyrealsense2 or what it needs is absent.
        DdsError: the domain cannot be joined.
    """
    wanted = CAMERAS[config.camera]
    camera = RealSense(wanted, partial(device_frames, wanted, config.serial))
    with (
        interrupted() as stop,
        closing(AsyncLogger()) as tell,
        member(f"camera_{config.camera}", config.dds, tell) as (participant, node),
    ):
        process = CameraProcess(participant, node, config.camera, camera, time.monotonic, tell)
        tell(f"The {config.camera} camera is on {config.dds}. Ctrl-C ends its driver.")
        while not stop.wait(TICK):
            process.step()
