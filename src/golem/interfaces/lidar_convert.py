"""LiDAR scans, samples of its IMU, and odometry from outside, as messages of ROS 2 and back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.interfaces import images
from golem.interfaces.lidar import ExternalOdometry, LidarImu, LidarScan
from golem.interfaces.ros_convert import header, matrix, pose, seconds, vector
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.geometry_msgs import Vector3
from golem.middleware.ros.msgs.livox_ros_driver2 import CustomMsg, CustomPoint
from golem.middleware.ros.msgs.nav_msgs import Odometry
from golem.middleware.ros.msgs.sensor_msgs import Imu, PointCloud2
from golem.types import Array

FRAME = "lidar_link"
LEAST_DURATION = 0.1
"""Time from the first point of a cloud to its end, where its points do not reach further [s]: that of one scan."""
ROUNDING = 1e-6
"""By how much a point may be before its cloud's stamp: one is rounded to ns, the other to a double of 1e18 ns [s]."""
GOOD_RETURN = 0x10
"""Tag of a point that the vendor's driver is sure of."""


def cloud(scan: LidarScan) -> PointCloud2:
    """Return a scan as the vendor's driver publishes it on /livox/pointcloud."""
    begin = scan.t - scan.duration
    points = np.zeros(len(scan.points), images.LIVOX_POINT)
    points["x"], points["y"], points["z"] = scan.points.T
    points["tag"], points["timestamp"] = GOOD_RETURN, 1e9 * (begin + scan.offsets.astype(np.float64))
    return images.point_cloud(begin, points, FRAME)


def to_scan(message: PointCloud2) -> LidarScan:
    """Return the scan in a cloud of the vendor's driver. Raises CodecError: it lacks a field, or contradicts itself."""
    points = images.to_points(message)
    names = points.dtype.names or ()
    missing = [name for name in ("x", "y", "z", "timestamp") if name not in names]
    if missing:
        raise CodecError(f"The cloud has no field '{missing[0]}'; a LiDAR scan has x, y, z and timestamp [ns].")
    begin = seconds(message.header.stamp)
    offsets = 1e-9 * points["timestamp"].astype(np.float64) - begin
    order = np.argsort(offsets, kind="stable")
    xyz = np.stack([points[name] for name in ("x", "y", "z")], axis=1).astype(np.float32)
    finite = offsets[np.isfinite(offsets)]
    if finite.size and not -ROUNDING <= finite.min() <= finite.max() < 1.0:
        raise CodecError("The points of the cloud are not of the second after its stamp.")
    offsets = np.maximum(offsets, 0.0)
    duration = max(LEAST_DURATION, float(finite.max(initial=0.0)))
    return LidarScan(begin + duration, xyz[order], offsets[order].astype(np.float32), duration)


def custom(scan: LidarScan) -> CustomMsg:
    """Return a scan in the driver's own type, as on /livox/lidar."""
    begin = scan.t - scan.duration
    times = np.round(1e9 * scan.offsets.astype(np.float64)).astype(np.int64).tolist()
    points = [
        CustomPoint(at, x, y, z, 0, GOOD_RETURN, 0) for at, (x, y, z) in zip(times, scan.points.tolist(), strict=True)
    ]
    return CustomMsg(header(begin, FRAME), round(1e9 * begin), len(points), points=points)


def imu(sample: LidarImu) -> Imu:
    """Return a sample of the IMU inside the LiDAR; it tells no orientation."""
    message = Imu(header(sample.t, FRAME), angular_velocity=vector(sample.gyro))
    message.linear_acceleration = vector(sample.acc)
    message.orientation_covariance[0] = -1.0
    return message


def to_imu(message: Imu) -> LidarImu:
    """Return the sample in a message."""
    t = seconds(message.header.stamp)
    return LidarImu(t, _array(message.angular_velocity), _array(message.linear_acceleration))


def odometry(said: ExternalOdometry) -> Odometry:
    """Return what an odometry outside of this stack would say; its frame has no name here."""
    message = Odometry(header(said.t), said.child)
    message.pose.pose, message.pose.covariance = pose(said.T_frame_child), said.covariance.ravel().copy()
    message.twist.twist.linear, message.twist.twist.angular = vector(said.velocity), vector(said.rate)
    return message


def to_odometry(message: Odometry) -> ExternalOdometry:
    """Return what an odometry outside of this stack says. Raises CodecError: its pose is none."""
    twist = message.twist.twist
    covariance: NDArray[np.float64] = np.array(message.pose.covariance, dtype=np.float64).reshape(6, 6)
    t, T = seconds(message.header.stamp), matrix(message.pose.pose)
    return ExternalOdometry(t, T, _array(twist.linear), _array(twist.angular), covariance, message.child_frame_id)


def _array(v: Vector3) -> Array:
    return np.array([v.x, v.y, v.z])
