"""Our LiDAR-inertial odometry on a made-up room: it follows, bridges gaps, and is silent where it cannot know."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from golem.capabilities.odometry.base import LidarOdometry, OdometryEstimate
from golem.capabilities.odometry.error_state import ImuNoise
from golem.capabilities.odometry.lio import Lio, LioConfig
from golem.evaluation.conformance.room import HEIGHT, ROOM, MadeWalk, Reading
from golem.interfaces.lidar import LegOdometry, LidarImu, LidarScan

TUNNEL = np.array([[-1e3, 1e3], [-1.2, 1.2], [-HEIGHT, 2.5]])
"""A box without ends."""
WALK = MadeWalk(ROOM, every=5)
Change = Callable[[LidarScan], LidarScan | None]


def give(odometry: LidarOdometry, reading: Reading) -> None:
    if isinstance(reading, LidarImu):
        odometry.add_imu(reading)
    elif isinstance(reading, LegOdometry):
        odometry.add_legs(reading)
    elif isinstance(reading, LidarScan):
        odometry.add_scan(reading)


def run(
    odometry: LidarOdometry, seconds: float, walk: MadeWalk = WALK, change: Change = lambda scan: scan
) -> list[OdometryEstimate | None]:
    """Let the base walk, every scan changed or left out; return what the odometry says after each."""
    told: list[OdometryEstimate | None] = []
    for tenth in walk.tenths(seconds):
        for reading in tenth:
            one = change(reading) if isinstance(reading, LidarScan) else reading
            if one is not None:
                give(odometry, one)
        told.append(odometry.estimate())
    return told


def off(estimate: OdometryEstimate | None, walk: MadeWalk = WALK) -> float:
    """Return by how much x is off [m]."""
    assert estimate is not None
    return float(estimate.T_odom_base[0, 3]) - walk.way(estimate.t)


@pytest.mark.slow
def test_it_follows_within_two_centimetres_and_starts_level() -> None:
    odometry = Lio()
    assert isinstance(odometry, LidarOdometry)
    told = [estimate for estimate in run(odometry, 8.0) if estimate is not None]
    assert len(told) > 60
    assert max(abs(off(estimate)) for estimate in told) < 0.02
    assert np.abs(told[-1].T_odom_base[1:3, 3]).max() < 0.03
    assert told[-1].velocity == pytest.approx([WALK.speed, 0.0, 0.0], abs=0.03)
    assert np.linalg.eigvalsh(told[-1].covariance).min() > 0.0
    assert not odometry.degenerate.any()


def test_the_same_data_give_the_same_numbers() -> None:
    first, again = (run(Lio(), 3.0)[-1] for _ in range(2))
    assert first is not None and again is not None
    assert np.array_equal(first.T_odom_base, again.T_odom_base)
    assert np.array_equal(first.covariance, again.covariance)


def test_it_is_silent_until_the_robot_has_stood_still_and_says_so() -> None:
    odometry = Lio()
    told = run(odometry, 0.5)
    assert told[0] is None and "stands still" in odometry.why
    assert run(Lio(), 1.5)[-1] is not None


def test_the_legs_teach_it_how_the_sensor_is_turned_on_its_mount() -> None:
    walk, odometry = replace(WALK, yaw=0.03), Lio()
    (told,) = run(odometry, 12.0, walk)[-1:]
    yaw, deviation = odometry.sensor_yaw
    assert yaw == pytest.approx(0.03, abs=2.0 * deviation) and deviation < 0.012
    assert told is not None and abs(told.T_odom_base[1, 3]) < 0.05
    assert told.T_base_lidar[:3, :3] == pytest.approx(walk.T_base_lidar[:3, :3], abs=0.02)


def test_what_an_earlier_walk_taught_is_an_option() -> None:
    walk = replace(WALK, yaw=0.03)
    (told,) = run(Lio(LioConfig(yaw=0.03, imu=ImuNoise(yaw=0.002))), 6.0, walk)[-1:]
    assert told is not None and abs(told.T_odom_base[1, 3]) < 0.02


def test_it_begins_on_the_way_where_the_legs_tell_how_it_moves() -> None:
    walk = replace(WALK, still=0.0, shaking=0.5)
    odometry = Lio()
    told = run(odometry, 8.0, walk)
    first = next(estimate for estimate in told if estimate is not None)
    last = told[-1]
    assert 3.0 < first.t < 4.5 and last is not None
    gone = last.T_odom_base[0, 3] - first.T_odom_base[0, 3]
    assert gone == pytest.approx(walk.way(last.t) - walk.way(first.t), abs=0.05)
    assert last.T_odom_base[2, 2] > np.cos(0.03)


def test_without_legs_it_does_not_begin_on_the_way() -> None:
    assert run(Lio(), 5.0, replace(WALK, still=0.0, shaking=0.5, legs=False))[-1] is None


def test_a_gap_of_a_second_is_bridged() -> None:
    told = run(Lio(), 6.0, change=lambda scan: None if 4.0 <= scan.t < 5.0 else scan)
    assert abs(off(told[-1])) < 0.02


def test_a_long_gap_silences_it_and_it_says_so() -> None:
    odometry = Lio(LioConfig(silent_at=1.0))
    told = run(odometry, 6.0, change=lambda scan: None if scan.t >= 4.0 else scan)
    assert told[35] is not None and told[-1] is None
    assert "No scan has fitted" in odometry.why


def test_without_scans_it_does_not_keep_every_sample_and_goes_on_when_they_come_back() -> None:
    odometry = Lio(LioConfig(silent_at=0.5))
    told = run(odometry, 8.0, change=lambda scan: None if 4.0 <= scan.t < 6.6 else scan)
    assert told[60] is None and len(odometry._buffer) < 300
    assert abs(off(told[-1])) < 0.05
    run(odometry := Lio(LioConfig(silent_at=0.5)), 6.0, change=lambda scan: None)
    assert len(odometry._buffer) < 300, "of 200 a second for 6 s"


def test_a_frozen_scan_is_left_out_and_silences_it() -> None:
    held: list[LidarScan] = []

    def freeze(scan: LidarScan) -> LidarScan:
        held[:] = held if scan.t >= 4.0 else [scan]
        return held[0]

    odometry = Lio(LioConfig(silent_at=1.0))
    assert run(odometry, 6.0, change=freeze)[-1] is None and odometry.why


def test_points_that_freeze_under_new_stamps_are_left_out_and_silence_it() -> None:
    held: list[LidarScan] = []

    def freeze(scan: LidarScan) -> LidarScan:
        held[:] = held if scan.t >= 4.0 else [scan]
        return replace(held[0], t=scan.t)

    odometry = Lio(LioConfig(silent_at=1.0))
    (told,) = run(odometry, 6.0, change=freeze)[-1:]
    assert told is None and "No scan has fitted" in odometry.why


def test_a_tunnel_is_degenerate_along_its_axis_and_the_legs_answer() -> None:
    odometry, walk = Lio(), replace(WALK, walls=TUNNEL)
    told = run(odometry, 8.0, walk)
    assert abs(odometry.degenerate[0]) > 0.99
    assert abs(off(told[-1], walk)) < 0.05


def test_a_tunnel_without_legs_is_not_taken_for_known() -> None:
    odometry, walk = Lio(LioConfig(legs=False)), replace(WALK, walls=TUNNEL, legs=False)
    (told,) = run(odometry, 12.0, walk)[-1:]
    if told is not None:
        assert abs(off(told, walk)) < 3.0 * np.sqrt(told.covariance[0, 0])


def test_bad_measurements_are_left_out() -> None:
    odometry = Lio()
    before = run(odometry, 3.0)[-1]
    assert before is not None
    good = WALK.scan(3.1, np.random.default_rng(0))
    nan = np.full(3, np.nan)
    odometry.add_imu(LidarImu(3.005, nan, nan))
    odometry.add_imu(LidarImu(1.0, np.zeros(3), np.zeros(3)))
    odometry.add_scan(replace(good, t=1e6))
    odometry.add_scan(replace(good, t=2.0))
    odometry.add_legs(LegOdometry(3.1, np.eye(4), nan, 0.0))
    after = odometry.estimate()
    assert after is not None and np.array_equal(before.T_odom_base, after.T_odom_base)


@pytest.mark.parametrize("every", [7, 4])
def test_points_that_are_not_finite_are_left_out(every: int) -> None:
    def spoil(scan: LidarScan) -> LidarScan:
        points = scan.points.copy()
        points[::every] = np.nan
        return replace(scan, points=points)

    assert abs(off(run(Lio(), 4.0, change=spoil)[-1])) < 0.02
