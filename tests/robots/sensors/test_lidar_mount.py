"""What the LiDAR says is brought to where the model has the sensor."""

from __future__ import annotations

import numpy as np

from golem.capabilities.calibration.kinematic_fit import pose
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.robots.sensors.calibration import LidarCorrection


def test_points_and_axes_are_turned_and_moved() -> None:
    T = pose(np.array([0.01, -0.02, 0.03, 0.004, 0.005, -0.006]))
    points = np.array([[1.0, 2.0, 3.0], [-4.0, 0.5, 0.1]], np.float32)
    scan = LidarScan(0.1, points, np.zeros(2, np.float32), 0.1)
    sample = LidarImu(0.1, np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, 9.81]))
    correction = LidarCorrection(T)
    there = correction.scan(scan)
    np.testing.assert_allclose(there.points, points @ T[:3, :3].T + T[:3, 3], atol=1e-5)
    assert there.points.dtype == np.float32 and there.t == scan.t
    imu = correction.imu(sample)
    np.testing.assert_allclose(imu.gyro, T[:3, :3] @ sample.gyro, atol=1e-6)
    np.testing.assert_allclose(imu.acc, T[:3, :3] @ sample.acc, atol=1e-5)


def test_without_a_calibration_nothing_changes() -> None:
    scan = LidarScan(0.1, np.ones((3, 3), np.float32), np.zeros(3, np.float32), 0.1)
    sample = LidarImu(0.1, np.ones(3), np.ones(3))
    assert LidarCorrection(None).scan(scan) is scan and LidarCorrection(None).imu(sample) is sample
