"""The odometries beside our own: legs, adapters of packages, and whoever speaks from outside."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from golem import registry
from golem.capabilities.odometry.base import lidar_in_base
from golem.capabilities.odometry.external_topic import ExternalTopic, ExternalTopicConfig
from golem.capabilities.odometry.legs import Legs
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.conformance.room import ROOM, MadeWalk
from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.robots.model.spatial import rotation_rpy, transform
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import Array


def legs_at(t: float, x: float, **changes: object) -> LegOdometry:
    T = transform((1.0 + x, 2.0, 0.9), rotation_rpy(0.0, 0.1, 0.5))
    said = LegOdometry(t, T, np.array([0.5, 0.0, 0.0]), 0.2)
    return replace(said, **changes)  # pyright: ignore[reportArgumentType]


def test_legs_count_from_where_the_robot_stood_first() -> None:
    odometry = Legs()
    assert odometry.estimate() is None and odometry.why
    odometry.add_legs(legs_at(0.0, 0.0))
    first = odometry.estimate()
    assert first is not None
    np.testing.assert_allclose(first.T_odom_base, transform(np.zeros(3), rotation_rpy(0.0, 0.1, 0.0)), atol=1e-9)
    odometry.add_legs(legs_at(0.1, 1.0))
    after = odometry.estimate()
    assert after is not None
    np.testing.assert_allclose(after.T_odom_base[:3, 3], [np.cos(0.5), -np.sin(0.5), 0.0], atol=1e-9)
    np.testing.assert_allclose(after.T_base_lidar, lidar_in_base(0.2))


def test_stale_legs_are_silent_and_say_so() -> None:
    odometry = Legs()
    odometry.add_legs(legs_at(0.0, 0.0))
    odometry.add_legs(legs_at(0.1, 0.0, stale=True))
    assert odometry.estimate() is None and "stale" in odometry.why
    odometry.add_legs(legs_at(0.2, 0.0))
    assert odometry.estimate() is not None and not odometry.why


def test_legs_of_the_past_and_without_numbers_are_left_out() -> None:
    odometry = Legs()
    odometry.add_legs(legs_at(1.0, 0.0))
    odometry.add_legs(legs_at(0.5, 5.0))
    odometry.add_legs(legs_at(1.5, 5.0, velocity=np.full(3, np.nan)))
    estimate = odometry.estimate()
    assert estimate is not None and estimate.t == 1.0


def outside(t: float, x: float, T_start: np.ndarray) -> ExternalOdometry:
    """Return what FAST-LIO says after `x` [m] straight on: the pose of the LiDAR's IMU where it was at first."""
    T_base_imu = lidar_in_base(0.0) @ transform(P_LIDAR_IMU)
    moved = T_start @ np.linalg.inv(T_base_imu) @ transform((x, 0.0, 0.0)) @ T_base_imu
    v = T_base_imu[:3, :3].T @ np.array([0.5, 0.0, 0.0])
    return ExternalOdometry(t, moved, v, np.zeros(3), np.zeros((6, 6)))


def test_what_is_said_outside_of_the_lidars_imu_becomes_a_level_pose_of_the_base() -> None:
    odometry = ExternalTopic()
    assert "/Odometry" in odometry.why
    for k in range(3):
        odometry.add_legs(legs_at(1.0 * k, 0.0, waist=0.0))
        odometry.add_external(outside(1.0 * k, 0.5 * k, np.eye(4)))
    estimate = odometry.estimate()
    assert estimate is not None
    np.testing.assert_allclose(estimate.T_odom_base, transform((1.0, 0.0, 0.0)), atol=1e-9)
    np.testing.assert_allclose(estimate.velocity, [0.5, 0.0, 0.0], atol=1e-9)


def test_a_level_frame_of_the_base_is_taken_as_it_is() -> None:
    odometry = ExternalTopic(ExternalTopicConfig(child="base_link", level=True))
    T = transform((3.0, 1.0, 0.7), rotation_rpy(0.0, 0.05, 1.0))
    zero = np.zeros(3)
    odometry.add_external(ExternalOdometry(0.0, T, zero, zero, np.zeros((6, 6))))
    estimate = odometry.estimate()
    assert estimate is not None
    np.testing.assert_allclose(estimate.T_odom_base, transform(zero, rotation_rpy(0.0, 0.05, 0.0)), atol=1e-9)


def test_who_falls_silent_outside_is_silent_inside() -> None:
    odometry = ExternalTopic()
    odometry.add_external(outside(0.0, 0.0, np.eye(4)))
    odometry.add_legs(legs_at(0.4, 0.0))
    assert odometry.estimate() is not None
    odometry.add_legs(legs_at(1.0, 0.0))
    assert odometry.estimate() is None and "for 1.0 s" in odometry.why


def drive(pose: Callable[[float], np.ndarray], rate: float = 10.0, velocity: float = 0.0) -> ExternalTopic:
    """Tell `pose` (t -> (4, 4)) for 4 s, and return the odometry."""
    odometry = ExternalTopic(ExternalTopicConfig(child="base_link", level=True))
    v, zero = np.array([velocity, 0.0, 0.0]), np.zeros(3)
    for t in np.arange(0.0, 4.0, 1.0 / rate):
        odometry.add_legs(legs_at(t, 0.0))
        odometry.add_external(ExternalOdometry(t, pose(t), v, zero, np.zeros((6, 6))))
    return odometry


def flipped(t: float) -> np.ndarray:
    return transform((0.3 * t, 0.0, 0.0), np.diag([1.0, -1.0, -1.0]))


IMPOSSIBLE = {
    "a jump of 3 m": (lambda t: transform((0.3 * t + 3.0 * (t > 2.0), 0.0, 0.0)), 10.0, 0.0, "3.03 m"),
    "a jump of 1 m": (lambda t: transform((0.3 * t, 1.0 * (t > 2.0), 0.0)), 10.0, 0.0, "has moved the robot 1.0"),
    "a jump up": (lambda t: transform((0.0, 0.0, 0.9 * (t > 2.0))), 10.0, 0.0, "has moved the robot 0.90 m"),
    "a restart at zero": (lambda t: transform((1.0 * t * (t < 2.0), 0.0, 0.0)), 10.0, 0.0, "has moved the robot"),
    "100 m/s": (lambda t: transform((100.0 * t, 0.0, 0.0)), 10.0, 0.0, "has moved the robot 10.00 m"),
    "100 m/s, 500 Hz": (lambda t: transform((100.0 * t, 0.0, 0.0)), 500.0, 0.0, "has moved the robot 0"),
    "10 m/s": (lambda t: transform((10.0 * t, 0.0, 0.0)), 100.0, 0.0, "has moved the robot"),
    "a turn by 180 degrees": (
        lambda t: transform((0.0, 0.0, 0.0), rotation_rpy(0.0, 0.0, np.pi * (t > 2.0))),
        10.0,
        0.0,
        "3.1 rad in 0.1",
    ),
    "upside down": (flipped, 10.0, 0.0, "tilted by 180 degrees"),
    "on its side": (lambda t: transform((0.0, 0.0, 0.0), rotation_rpy(1.57, 0.0, 0.0)), 10.0, 0.0, "by 90 deg"),
    "a velocity of 100 m/s": (lambda t: transform((0.3 * t, 0.0, 0.0)), 10.0, 100.0, "move at 100.0 m/s"),
}


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_what_no_robot_can_do_is_not_believed(what: str) -> None:
    pose, rate, velocity, said = IMPOSSIBLE[what]
    odometry = drive(pose, rate, velocity)
    assert odometry.estimate() is None
    assert odometry.why.startswith("What comes on /Odometry has") and said in odometry.why
    odometry.reset()
    odometry.add_external(ExternalOdometry(9.0, np.eye(4), np.zeros(3), np.zeros(3), np.zeros((6, 6))))
    assert odometry.estimate() is not None


@pytest.mark.parametrize("rate", [5.0, 10.0, 50.0, 500.0])
def test_what_a_robot_can_do_is_believed(rate: float) -> None:
    turn = 1.5
    odometry = drive(lambda t: transform((1.5 * t, 0.0, 0.0), rotation_rpy(0.1, 0.0, turn * t)), rate, 1.5)
    estimate = odometry.estimate()
    assert odometry.why == "" and estimate is not None
    assert estimate.T_odom_base[0, 3] == pytest.approx(1.5 * estimate.t)


def test_one_wrong_pose_passes() -> None:
    odometry = drive(lambda t: transform((0.3 * t + 5.0 * (1.95 < t < 2.05), 0.0, 0.0)))
    estimate = odometry.estimate()
    assert estimate is not None and estimate.T_odom_base[0, 3] == pytest.approx(0.3 * 3.9)


def test_a_wrong_child_is_answered_with_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match="one of base_link, lidar, lidar_imu, not 'body'"):
        registry.create("odometry", "topic", {"child": "body"})


@pytest.mark.parametrize(("use", "package"), [("kiss_icp", "kiss-icp"), ("rko_lio", "rko-lio")])
def test_a_missing_package_is_named_with_the_line_that_installs_it(
    use: str, package: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (use, f"{use}.config", f"{use}.{use}", f"{use}.lio", f"{use}.config.config"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingExtra, match=rf"'{package}'.*golem-humanoid\[lidar\]"):
        registry.create("odometry", use, {})


@pytest.mark.parametrize("use", ["kiss_icp", "rko_lio"])
def test_an_adapter_registers_scans_and_leaves_bad_ones_out(use: str) -> None:
    pytest.importorskip(use)
    odometry = registry.create("odometry", use, {})
    last: LidarScan | None = None
    for tenth in MadeWalk(ROOM, every=5).tenths(1.6):
        for reading in tenth:
            if isinstance(reading, LidarImu):
                odometry.add_imu(reading)
            elif isinstance(reading, LidarScan):
                last = reading
                odometry.add_scan(reading)
    before = odometry.estimate()
    assert before is not None and last is not None and np.linalg.norm(before.T_odom_base[:3, 3]) < 0.15
    odometry.add_scan(last)  # it comes twice
    odometry.add_scan(replace(last, t=float("nan")))
    again = odometry.estimate()
    assert again is not None and again.t == before.t
    np.testing.assert_array_equal(again.T_odom_base, before.T_odom_base)
    few = replace(last, t=last.t + 0.1, points=last.points[:50], offsets=last.offsets[:50])
    odometry.add_imu(LidarImu(few.t, np.zeros(3), np.array([0.0, 0.0, -9.81])))
    odometry.add_scan(few)
    assert odometry.estimate() is None and "fewer than" in odometry.why


def test_points_without_times_of_their_own_are_not_corrected_for_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("kiss_icp")
    odometry = registry.create("odometry", "kiss_icp", {})
    given: list[int] = []
    register = odometry._icp.register_frame

    def registered(points: Array, offsets: Array) -> None:
        given.append(len(offsets))
        register(points, offsets)

    monkeypatch.setattr(odometry._icp, "register_frame", registered)
    scans = [r for tenth in MadeWalk(ROOM, every=5).tenths(0.3) for r in tenth if isinstance(r, LidarScan)]
    for scan, same in zip(scans, (False, True, True), strict=True):
        odometry.add_scan(replace(scan, offsets=np.full_like(scan.offsets, 0.1)) if same else scan)
    assert given[0] > 1000 and given[1:] == [0, 0]
    estimate = odometry.estimate()
    assert estimate is not None and np.linalg.norm(estimate.T_odom_base[:3, 3]) < 0.05
