"""What a LiDAR with an IMU inside it says, and what the legs say about the motion of the base."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from golem.types import Array


@dataclass(frozen=True, slots=True)
class LidarScan:
    """The points of one scan, in the order in which they were measured.

    Attributes:
        t: time of the scan's end [s]; no point is later.
        points: (n, 3) float32 in lidar_link at each point's own time [m].
        offsets: (n,) float32 time of each point after the scan's begin [s], ascending.
        duration: time from the scan's begin to `t` [s].
    """

    t: float
    points: NDArray[np.float32]
    offsets: NDArray[np.float32]
    duration: float


@dataclass(frozen=True, slots=True)
class LidarImu:
    """One sample of the IMU inside the LiDAR, in the axes of lidar_link.

    Attributes:
        t: end of the interval whose mean it is [s].
        gyro: (3,) angular rate [rad/s].
        acc: (3,) specific force at the IMU, +9.81 along up at rest [m/s^2].
    """

    t: float
    gyro: Array
    acc: Array


@dataclass(frozen=True, slots=True)
class LegOdometry:
    """What joints and torso IMU say about the motion of the base, by the base estimator.

    Attributes:
        t: time [s].
        T_odom_base: (4, 4) pose of base_link in the estimator's odom.
        velocity: (3,) of base_link in base_link [m/s].
        waist: position of `torso_joint` [rad], which turns the LiDAR on base_link.
        stale: whether pose and velocity are not to be relied on; `waist` is.
        rate: (3,) angular rate of base_link in base_link [rad/s].
    """

    t: float
    T_odom_base: Array
    velocity: Array
    waist: float
    stale: bool = False
    rate: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True, slots=True)
class ExternalOdometry:
    """What an odometry outside of this stack says, as nav_msgs/Odometry has it.

    Attributes:
        t: time of the measurement [s].
        T_frame_child: (4, 4) pose of its child frame in its own frame.
        velocity: (3,) of the child frame in the child frame [m/s].
        rate: (3,) angular rate of the child frame in the child frame [rad/s].
        covariance: (6, 6) of the pose: place [m^2], then rotation about the fixed axes [rad^2]. Zero where it has none.
        child: name of the child frame; empty where it has none.
    """

    t: float
    T_frame_child: Array
    velocity: Array
    rate: Array
    covariance: Array
    child: str = ""
