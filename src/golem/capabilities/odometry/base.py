"""The contract of an odometry: LiDAR scans, their IMU and the legs in, pose and twist of base_link in odom out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np

from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.robots.model.spatial import transform
from golem.robots.model.table import FRAMES
from golem.types import Array, PlanarPose

Source = Literal["imu", "legs", "scan", "external"]
"""What an odometry may go by."""
SOURCES: tuple[Source, ...] = ("imu", "legs", "scan", "external")


@dataclass(frozen=True, slots=True)
class OdometryEstimate:
    """Where base_link is and how it moves.

    Attributes:
        t: time [s]: that of the newest IMU sample, or of the newest measurement of a method without an IMU.
        T_odom_base: (4, 4) pose of base_link in odom, which is level and has base_link at its origin, heading along x,
            when the odometry began.
        velocity: (3,) of base_link in odom [m/s].
        rate: (3,) angular rate of base_link in base_link [rad/s]; the waist's own may be in it.
        covariance: (6, 6) of the error of `T_odom_base`: its place in odom [m^2], then the rotation vector in odom
            [rad^2]. NaN where a method has none.
        T_base_lidar: (4, 4) pose of lidar_link in base_link as the method takes it to be; with it, points are posed.
    """

    t: float
    T_odom_base: Array
    velocity: Array
    rate: Array
    covariance: Array
    T_base_lidar: Array


@runtime_checkable
class LidarOdometry(Protocol):
    """Follows base_link by what its sensors say, in the order of arrival.

    A measurement that is not finite, comes out of order or belongs to another clock is left out. What a method does
    not go by may be withheld from it; the legs never are, since they tell the angle of the waist.

    Attributes:
        sources: what it goes by.
        why: one sentence why `estimate` returns None; empty where it does not.
    """

    sources: tuple[Source, ...]

    @property
    def why(self) -> str:
        """One sentence why it is silent; empty while it is not."""
        ...

    def reset(self) -> None:
        """Forget everything: odom begins anew where the robot stands next."""

    def add_imu(self, sample: LidarImu) -> None:
        """Take one sample of the IMU, at 200 Hz."""

    def add_legs(self, legs: LegOdometry) -> None:
        """Take what the legs say, at 100 Hz; a robot may have none."""

    def add_scan(self, scan: LidarScan) -> None:
        """Take one scan, at 10 Hz; it may arrive up to 0.2 s after its end."""

    def add_external(self, odometry: ExternalOdometry) -> None:
        """Take what an odometry outside of this stack says, at any rate."""

    def estimate(self) -> OdometryEstimate | None:
        """Return where the robot is; None before it is known, and while the method is lost."""
        ...


class Ignores:
    """Takes every measurement and leaves it at that; a method overrides what it goes by."""

    def add_imu(self, sample: LidarImu) -> None:
        """Leave a sample of the IMU out."""

    def add_legs(self, legs: LegOdometry) -> None:
        """Leave what the legs say out."""

    def add_scan(self, scan: LidarScan) -> None:
        """Leave a scan out."""

    def add_external(self, odometry: ExternalOdometry) -> None:
        """Leave an odometry outside of this stack out."""


T_TORSO_LIDAR: Array = FRAMES["lidar_link"].T_parent_frame
"""(4, 4) nominal pose of lidar_link in torso_link."""
BLIND = 0.5
"""Distance from the sensor within which a point is the robot's [m]."""
BODY: tuple[float, float, float, float, float, float] = (-0.45, -0.6, -1.2, 0.8, 0.6, 0.45)
"""Corners of a box in base_link within which a point is the robot's [m]: x, y, z of one, then of the other."""


def lidar_in_base(waist: float) -> Array:
    """Return the (4, 4) nominal pose of lidar_link in base_link with the waist at `waist` [rad]."""
    c, s = np.cos(waist), np.sin(waist)
    return transform((0.0, 0.0, 0.0), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])) @ T_TORSO_LIDAR


def of_the_world(points: Array, T_base_lidar: Array, blind: float = BLIND, body: tuple[float, ...] = BODY) -> Array:
    """Return (n,) which points (n, 3) in lidar_link [m] are finite and not the robot's own; see `BLIND` and `BODY`."""
    in_base = points @ T_base_lidar[:3, :3].T + T_base_lidar[:3, 3]
    corners = np.array(body)
    own = ((in_base > corners[:3]) & (in_base < corners[3:])).all(axis=1)
    square = (points * points).sum(axis=1)
    return (square > blind**2) & ~own & np.isfinite(square)


class OdomOrigin:
    """Puts odom where a method's own frame has base_link at first: level, at base_link, heading along x."""

    def __init__(self) -> None:
        self._T_odom_own: Array = np.eye(4)
        self._set = False

    def __call__(self, T_own_base: Array) -> Array:
        """Return the (4, 4) pose in odom of a pose in the method's own frame, whose z is up."""
        if not self._set:
            heading = PlanarPose.of(T_own_base).matrix()
            heading[2, 3] = T_own_base[2, 3]
            self._T_odom_own = np.asarray(np.linalg.inv(heading), dtype=np.float64)
            self._set = True
        return self._T_odom_own @ T_own_base


NO_COVARIANCE: Array = np.full((6, 6), np.nan)
"""Of a method that has none."""
