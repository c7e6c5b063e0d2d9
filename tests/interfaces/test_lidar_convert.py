"""What the LiDAR says comes back from its messages as it was, and what is no scan is refused."""

from __future__ import annotations

import numpy as np
import pytest

from golem.interfaces import lidar_convert
from golem.interfaces.images import LIVOX_POINT, point_cloud
from golem.interfaces.lidar import ExternalOdometry, LidarImu, LidarScan
from golem.middleware.ros import codec
from golem.middleware.ros.message import CodecError
from golem.robots.model.spatial import rotation_rpy, transform

POINTS = np.arange(30, dtype=np.float32).reshape(10, 3)
SCAN = LidarScan(12.3, POINTS, np.linspace(0.001, 0.1, 10, dtype=np.float32), 0.1)


def test_a_scan_survives_the_cloud() -> None:
    message = lidar_convert.cloud(SCAN)
    assert message.header.frame_id == "lidar_link"
    back = lidar_convert.to_scan(codec.deserialize(codec.serialize(message), type(message)))
    assert back.t == pytest.approx(SCAN.t, abs=1e-8) and back.duration == pytest.approx(0.1, abs=1e-8)
    np.testing.assert_array_equal(back.points, SCAN.points)
    np.testing.assert_allclose(back.offsets, SCAN.offsets, atol=1e-6)


def test_the_drivers_own_type_holds_the_same_points() -> None:
    message = lidar_convert.custom(SCAN)
    back = codec.deserialize(codec.serialize(message), type(message))
    assert (back.point_num, back.timebase) == (10, 12_200_000_000)
    assert [p.offset_time for p in back.points][0] == pytest.approx(1e6, abs=100.0)
    assert [(p.x, p.y, p.z) for p in back.points] == [tuple(p) for p in POINTS.tolist()]


def test_points_come_in_the_order_of_their_times() -> None:
    shuffled = LidarScan(SCAN.t, SCAN.points[::-1], SCAN.offsets[::-1], SCAN.duration)
    back = lidar_convert.to_scan(lidar_convert.cloud(shuffled))
    np.testing.assert_array_equal(back.points, SCAN.points)


def test_a_cloud_without_times_is_no_scan() -> None:
    with pytest.raises(CodecError, match="no field 'timestamp'"):
        lidar_convert.to_scan(point_cloud(1.0, POINTS, "lidar_link"))


@pytest.mark.parametrize("first", [0.0, 5e-6])
def test_the_first_point_may_be_at_the_scans_begin_whatever_the_stamp_is_rounded_to(first: float) -> None:
    ends = 1.7e9 + np.random.default_rng(0).uniform(0.0, 1.0, 200)
    for end in [*ends, *(ends - 1.7e9 + 1.0)]:
        scan = LidarScan(float(end), POINTS, np.linspace(first, 0.1, 10, dtype=np.float32), 0.1)
        back = lidar_convert.to_scan(lidar_convert.cloud(scan))
        assert back.offsets.min() >= 0.0
        np.testing.assert_allclose(back.offsets, scan.offsets, atol=1e-6)


def test_points_of_another_clock_are_no_scan() -> None:
    points = np.zeros(3, LIVOX_POINT)
    points["timestamp"] = 5e12
    with pytest.raises(CodecError, match="not of the second after its stamp"):
        lidar_convert.to_scan(point_cloud(1.0, points, "lidar_link"))


def test_an_empty_cloud_is_an_empty_scan() -> None:
    back = lidar_convert.to_scan(point_cloud(1.0, np.zeros(0, LIVOX_POINT), "lidar_link"))
    assert (back.t, len(back.points)) == (pytest.approx(1.1), 0)


def test_a_sample_of_the_imu_survives_and_tells_no_orientation() -> None:
    sample = LidarImu(3.005, np.array([0.1, -0.2, 0.3]), np.array([1.0, 2.0, -9.7]))
    message = lidar_convert.imu(sample)
    assert message.orientation_covariance[0] == -1.0
    back = lidar_convert.to_imu(message)
    assert back.t == pytest.approx(3.005, abs=1e-8)
    np.testing.assert_array_equal(np.append(back.gyro, back.acc), np.append(sample.gyro, sample.acc))


def test_an_odometry_from_outside_is_read_and_one_without_orientation_refused() -> None:
    T = transform((2.0, 0.0, 0.0), rotation_rpy(0.0, 0.0, 1.5))
    said = ExternalOdometry(1.5, T, np.array([0.5, 0.0, 0.0]), np.zeros(3), np.diag(np.arange(6.0)), "body")
    message = lidar_convert.odometry(said)
    read = lidar_convert.to_odometry(codec.deserialize(codec.serialize(message), type(message)))
    np.testing.assert_allclose(read.T_frame_child, T, atol=1e-12)
    assert (read.t, read.velocity[0], read.child) == (1.5, 0.5, "body")
    np.testing.assert_array_equal(read.covariance, said.covariance)
    message.pose.pose.orientation.w = message.pose.pose.orientation.z = 0.0
    with pytest.raises(CodecError):
        lidar_convert.to_odometry(message)
