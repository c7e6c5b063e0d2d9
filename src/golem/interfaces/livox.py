"""What the LiDAR says, as ROS messages of the vendor's driver."""

from __future__ import annotations

import numpy as np

from golem.interfaces.images import LIVOX_POINT, point_cloud
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.interfaces.ros_convert import header, vector
from golem.middleware.ros.msgs.sensor_msgs import Imu, PointCloud2

FRAME = "lidar_link"
"""Frame of everything that the LiDAR measures."""


def scan_cloud(scan: LidarScan) -> PointCloud2:
    """Return a scan as the vendor's driver packs it, stamped with its begin; each point has its own time [ns]."""
    begin = scan.t - scan.duration
    points = np.zeros(len(scan.points), LIVOX_POINT)
    for i, axis in enumerate("xyz"):
        points[axis] = scan.points[:, i]
    points["timestamp"] = 1e9 * (begin + scan.offsets.astype(np.float64))
    return point_cloud(begin, points, FRAME)


def lidar_imu(sample: LidarImu) -> Imu:
    """Return a sample of the LiDAR's IMU in SI units; ROS writes its unknown orientation as a covariance of -1."""
    message = Imu(
        header=header(sample.t, FRAME),
        angular_velocity=vector(sample.gyro),
        linear_acceleration=vector(sample.acc),
    )
    message.orientation_covariance[0] = -1.0
    return message
