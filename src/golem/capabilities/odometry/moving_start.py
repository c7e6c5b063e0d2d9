"""Where an inertial odometry begins that finds the robot on its way: level by IMU and legs."""

from __future__ import annotations

import math
from collections import deque

import numpy as np

from golem.capabilities.odometry.base import lidar_in_base
from golem.capabilities.odometry.error_state import exp
from golem.capabilities.odometry.still_start import Beginning, level
from golem.interfaces.lidar import LegOdometry, LidarImu
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import GRAVITY, Array

PATIENCE = 3.0
"""Time for which a robot that stands still is waited for [s]."""
WINDOW = 400
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
        self._window: deque[tuple[LidarImu, Array | None]] = deque(maxlen=WINDOW)
        self._first = math.nan

    def add(self, sample: LidarImu, legs: LegOdometry | None) -> Beginning | None:
        """Take a sample of the IMU and the newest word of the legs; return the begin, None while there is none."""
        last = self._window[-1][0].t if self._window else math.nan
        if not 0.0 < sample.t - last < 0.1:
            self._window.clear()
            self._first = sample.t
        fresh = legs is not None and not legs.stale and sample.t - legs.t < STALE
        self._window.append((sample, legs.velocity if legs is not None and fresh else None))
        if sample.t - self._first < PATIENCE or len(self._window) < WINDOW or legs is None:
            return None
        (first, before), (_, now) = self._window[0], self._window[-1]
        if before is None or now is None:
            return None
        T_base_lidar = lidar_in_base(legs.waist)
        R_base_imu = T_base_lidar[:3, :3]
        turned, force = np.eye(3), np.zeros(3)
        for (one, _), (later, _) in zip(
            reversed(list(self._window)[:-1]), reversed(list(self._window)[1:]), strict=True
        ):
            force += turned @ later.acc
            turned = turned @ exp(-(later.t - one.t) * later.gyro)
        duration = sample.t - first.t
        gained = (R_base_imu.T @ now - turned @ R_base_imu.T @ before) / duration
        up = force / (WINDOW - 1) - gained
        size = float(np.linalg.norm(up))
        if abs(size - GRAVITY) > FAR_FROM_G:
            return None
        R = level(R_base_imu @ up / size)
        rate = R_base_imu @ sample.gyro
        arm = R_base_imu @ P_LIDAR_IMU + T_base_lidar[:3, 3]
        velocity = R @ (now + np.cross(rate, arm))
        return Beginning(R @ R_base_imu, R @ arm, np.zeros(3), size, velocity, SPEED, TILT, BIAS)
