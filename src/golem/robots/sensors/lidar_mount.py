"""Brings what the LiDAR says to where the robot's model has the sensor, by its calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from golem.interfaces.lidar import LidarImu, LidarScan
from golem.types import Array


class LidarCorrection:
    """Corrects scans and IMU samples by a calibrated mount.

    Everything behind it may take the sensor for where the model has it. The place of the IMU in the sensor is left
    alone: a mount that is off by millimetres moves it by no more.
    """

    def __init__(self, pose: Array | None) -> None:
        """Correct by the (4, 4) pose of lidar_link in the nominal one; None corrects nothing."""
        self._R = None if pose is None else pose[:3, :3].astype(np.float32)
        self._p = None if pose is None else pose[:3, 3].astype(np.float32)

    def scan(self, scan: LidarScan) -> LidarScan:
        """Return `scan` with its points in the nominal lidar_link."""
        if self._R is None or self._p is None:
            return scan
        return replace(scan, points=scan.points @ self._R.T + self._p)

    def imu(self, sample: LidarImu) -> LidarImu:
        """Return `sample` in the axes of the nominal lidar_link."""
        if self._R is None:
            return sample
        return replace(sample, gyro=self._R @ sample.gyro, acc=self._R @ sample.acc)
