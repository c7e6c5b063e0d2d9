"""Where an inertial odometry begins: level and at rest."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from golem.capabilities.odometry.base import lidar_in_base
from golem.interfaces.lidar import LidarImu
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import GRAVITY, Array

WINDOW = 200
"""Samples for which the robot must stand still: 1 s."""
STILL_GYRO = 0.02
"""Standard deviation of the rate up to which the robot stands still, per axis [rad/s]."""
STILL_ACC = 0.3
"""The same of the specific force [m/s^2]."""
LARGEST_BIAS = 0.05
"""Mean rate from which it turns rather than being biased [rad/s]."""


@dataclass(frozen=True, slots=True)
class Beginning:
    """Where an inertial odometry begins, and how well that is known.

    Attributes:
        R: (3, 3) rotation of the IMU's axes in a level frame in which base_link heads along x.
        p: (3,) place of the IMU in it; base_link is at the origin [m].
        gyro_bias: (3,) [rad/s].
        force: mean specific force, of a robot at rest that of gravity [m/s^2].
        velocity: (3,) of the IMU [m/s].
        speed, tilt, bias: standard deviations per axis of the velocity [m/s], of gravity's x and y [m/s^2], and of the
            gyro's bias [rad/s]; None: that of the filter.
    """

    R: Array
    p: Array
    gyro_bias: Array
    force: float = GRAVITY
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    speed: float = 0.01
    tilt: float | None = None
    bias: float | None = None


class StillStart:
    """Waits for the robot to stand still."""

    def __init__(self) -> None:
        self._window: deque[LidarImu] = deque(maxlen=WINDOW)

    def add(self, sample: LidarImu, waist: float) -> Beginning | None:
        """Take a sample.

        Args:
            waist: position of `torso_joint` [rad].

        Returns:
            The begin; None while the robot has not stood still for long enough.
        """
        if self._window and not 0.0 < sample.t - self._window[-1].t < 0.1:
            self._window.clear()
        self._window.append(sample)
        if len(self._window) < WINDOW or len(self._window) % 10:
            return None
        gyro = np.array([s.gyro for s in self._window])
        acc = np.array([s.acc for s in self._window])
        bias = gyro.mean(axis=0)
        moving = gyro.std(axis=0).max() > STILL_GYRO or acc.std(axis=0).max() > STILL_ACC
        if moving or np.abs(bias).max() > LARGEST_BIAS:
            return None
        T_base_lidar = lidar_in_base(waist)
        up = T_base_lidar[:3, :3] @ acc.mean(axis=0)
        force = float(np.linalg.norm(up))
        up /= force
        R = level(up)
        arm = T_base_lidar[:3, 3] + T_base_lidar[:3, :3] @ P_LIDAR_IMU
        return Beginning(R @ T_base_lidar[:3, :3], R @ arm, bias, force)


def level(up: Array) -> Array:
    """Return the (3, 3) rotation without heading that takes the unit vector `up` (3,) of a body to the world's z."""
    pitch = -math.asin(max(-1.0, min(1.0, float(up[0]))))
    roll = math.atan2(float(up[1]), float(up[2]))
    (cr, sr), (cp, sp) = (math.cos(roll), math.sin(roll)), (math.cos(pitch), math.sin(pitch))
    return np.array([[cp, sp * sr, sp * cr], [0.0, cr, -sr], [-sp, cp * sr, cp * cr]])
