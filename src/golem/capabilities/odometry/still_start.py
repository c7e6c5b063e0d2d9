"""Where an inertial odometry begins: level and at rest, or level by IMU and legs where the robot is on its way."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np

from golem.capabilities.odometry.base import lidar_in_base
from golem.capabilities.odometry.error_state import Beginning, exp
from golem.interfaces.lidar import LegOdometry, LidarImu
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import GRAVITY, Array

PATIENCE = 3.0
"""Time for which a robot that stands still is waited for [s]."""
COUNTED = 400
"""Samples over which the specific force is averaged: 2 s, some strides."""
FAR_FROM_G = 0.5
"""How far the mean may be from gravity before it is no level [m/s^2]."""
STALE = 0.1
"""Age from which the legs' velocity does not count [s]."""
SPEED, TILT, BIAS = 0.1, 0.15, 0.008
"""Standard deviations of such a begin: velocity [m/s], gravity in x and y [m/s^2], gyro bias [rad/s]."""


class MovingStart:
    """Waits for the legs to tell the velocity, and takes the mean specific force beyond their acceleration for up."""

    def __init__(self) -> None:
        self._window: deque[tuple[LidarImu, Array | None]] = deque(maxlen=COUNTED)
        self._first = math.nan

    def add(self, sample: LidarImu, legs: LegOdometry | None) -> Beginning | None:
        """Take a sample of the IMU and the newest word of the legs; return the begin, None while there is none."""
        last = self._window[-1][0].t if self._window else math.nan
        if not 0.0 < sample.t - last < 0.1:
            self._window.clear()
            self._first = sample.t
        fresh = legs is not None and not legs.stale and sample.t - legs.t < STALE
        self._window.append((sample, legs.velocity if legs is not None and fresh else None))
        if sample.t - self._first < PATIENCE or len(self._window) < COUNTED or legs is None:
            return None
        (first, before), (_, now) = self._window[0], self._window[-1]
        if before is None or now is None:
            return None
        T_base_lidar = lidar_in_base(legs.waist)
        R_base_imu = T_base_lidar[:3, :3]
        turned, force = np.eye(3), np.zeros(3)
        for (later, _), (one, _) in pairwise(reversed(self._window)):
            force += turned @ later.acc
            turned = turned @ exp(-(later.t - one.t) * later.gyro)
        gained = (R_base_imu.T @ now - turned @ R_base_imu.T @ before) / (sample.t - first.t)
        up = force / (COUNTED - 1) - gained
        size = float(np.linalg.norm(up))
        if abs(size - GRAVITY) > FAR_FROM_G:
            return None
        R = level(R_base_imu @ up / size)
        rate = R_base_imu @ sample.gyro
        arm = R_base_imu @ P_LIDAR_IMU + T_base_lidar[:3, 3]
        velocity = R @ (now + np.cross(rate, arm))
        return Beginning(R @ R_base_imu, R @ arm, np.zeros(3), size, velocity, SPEED, TILT, BIAS)


WINDOW = 200
"""Samples for which the robot must stand still: 1 s."""
STILL_GYRO = 0.02
"""Standard deviation of the rate up to which the robot stands still, per axis [rad/s]."""
STILL_ACC = 0.3
"""The same of the specific force [m/s^2]."""
LARGEST_BIAS = 0.05
"""Mean rate from which it turns rather than being biased [rad/s]."""


class StillStart:
    """Waits for the robot to stand still."""

    def __init__(self) -> None:
        self._window: deque[LidarImu] = deque(maxlen=WINDOW)

    def add(self, sample: LidarImu, waist: float) -> Beginning | None:
        """Take a sample, with `torso_joint` at `waist` [rad]; return the begin, None until it stood still for long."""
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
