"""The node of the odometry: it hears LiDAR, legs and whoever is outside, and tells where the robot is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from golem.capabilities.odometry.base import LidarOdometry, OdometryEstimate
from golem.interfaces import topics
from golem.interfaces.lidar import LegOdometry
from golem.interfaces.payloads import Odometry, OdometrySilence
from golem.middleware.bus import Bus, News
from golem.robots.base import HasLidar
from golem.robots.model.imu_mount import TORSO, sensed_base_rate
from golem.robots.sensors.lidar_mount import LidarCorrection
from golem.runtime.contract_check import ContractCheck
from golem.types import TICK, Array

PERIOD = 0.01
"""Time between two poses that are published, and between two words of the legs [s]."""


class OdometryNode:
    """Runs an odometry that goes by more than the legs. While that is silent, so is the node."""

    period = PERIOD
    wakes = topics.LIDAR_IMU, topics.LIDAR_SCAN, topics.EXTERNAL_ODOMETRY

    def __init__(self, bus: Bus, odometry: LidarOdometry, contract: ContractCheck, mount: Array | None = None) -> None:
        """Run `odometry`, with the LiDAR at `mount` (4, 4) in the nominal lidar_link; None is there."""
        self._bus, self._odometry, self._contract = bus, odometry, contract
        self._correction = LidarCorrection(mount)
        self._imu = News(bus, topics.LIDAR_IMU)
        self._scan = News(bus, topics.LIDAR_SCAN)
        self._external = News(bus, topics.EXTERNAL_ODOMETRY)
        self._next = 0.0
        self._why = ""

    def step(self, t: float) -> None:
        """Pass on what is new, and publish the pose that is due."""
        call, odometry = self._contract.call, self._odometry
        if (sample := self._imu.read()) is not None:
            call(odometry.add_imu, self._correction.imu(sample))
        due = t >= self._next - 1e-9
        if due:
            self._add_legs(t)
        if (scan := self._scan.read()) is not None:
            call(odometry.add_scan, self._correction.scan(scan))
        if (external := self._external.read()) is not None:
            call(odometry.add_external, external)
        if not due:
            return
        self._next = t + PERIOD
        estimate = call(odometry.estimate)
        if estimate is not None:
            self._contract.kind("the estimate", estimate, OdometryEstimate)
            T = self._contract.array("T_odom_base", estimate.T_odom_base, 4, 4)
            T_lidar = self._contract.array("T_base_lidar", estimate.T_base_lidar, 4, 4)
            known = estimate.covariance if np.isfinite(estimate.covariance).all() else None
            self._bus.publish(topics.ODOMETRY, Odometry(float(estimate.t), T, T_lidar, known), t)
        why = odometry.why if estimate is None else ""
        if why != self._why:
            self._why = why
            self._bus.publish(topics.ODOMETRY_SILENCE, OdometrySilence(t, why), t)

    def _add_legs(self, t: float) -> None:
        state, base = self._bus.latest(topics.LOW_STATE), self._bus.latest(topics.BASE)
        if state is None or base is None:
            return
        T = base.T_odom_base
        v, rate = T[:3, :3].T @ base.velocity, sensed_base_rate(state)
        legs = LegOdometry(t, T, v, float(state.q[TORSO]), base.stale, rate)
        self._contract.call(self._odometry.add_legs, legs)


class LidarNode:
    """Publishes what the LiDAR of a robot says: every tick, or as often as its IMU has a sample."""

    def __init__(self, bus: Bus, robot: HasLidar, wanted: Callable[[], bool], contract: ContractCheck) -> None:
        """Read the LiDAR of `robot`, while `wanted` says that somebody listens."""
        self._bus, self._robot, self._wanted, self._contract = bus, robot, wanted, contract
        self.period = contract.number("lidar_period", getattr(robot, "lidar_period", TICK), TICK)

    def step(self, t: float) -> None:
        """Publish what is new."""
        if not self._wanted():
            return
        samples, scan = self._contract.call(self._robot.lidar, t)
        for sample in samples:
            self._bus.publish(topics.LIDAR_IMU, sample, t)
        if scan is not None:
            self._bus.publish(topics.LIDAR_SCAN, scan, t)
