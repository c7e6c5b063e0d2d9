"""Sensors that contradict each other: our odometry is right within 5 cm, or lost, and says why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from tests.capabilities.odometry.test_lio import give

from golem.capabilities.odometry.base import T_TORSO_LIDAR
from golem.capabilities.odometry.lio import Lio
from golem.evaluation.conformance.room import ROOM, MadeWalk, Reading
from golem.interfaces.lidar import LegOdometry, LidarImu, LidarScan
from golem.robots.model.spatial import rotation_rpy
from golem.types import Array

Change = Callable[[Reading], Reading]
FLIP, BACK, LEFT = np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, -1.0, 1.0]), rotation_rpy(0, 0, np.pi / 2)
LATER = 3.0
"""When a clock jumps, on the way [s]."""


def turned(points: Array | None = None, imu: Array | None = None) -> Change:
    def change(reading: Reading) -> Reading:
        if isinstance(reading, LidarScan) and points is not None:
            return replace(reading, points=(reading.points @ points.T).astype(np.float32))
        if isinstance(reading, LidarImu) and imu is not None:
            return replace(reading, acc=imu @ reading.acc, gyro=imu @ reading.gyro)
        return reading

    return change


def shifted(kind: type | tuple[type, ...], by: float, since: float = 0.0) -> Change:
    return lambda reading: (
        replace(reading, t=reading.t + by) if isinstance(reading, kind) and reading.t > since else reading
    )


def scaled(by: float) -> Change:
    return lambda reading: replace(reading, acc=by * reading.acc) if isinstance(reading, LidarImu) else reading


LOST = {
    "points upside down": (turned(points=FLIP), "outside the LiDAR's field of view"),
    "points on their side": (turned(points=rotation_rpy(np.pi / 2, 0, 0)), "outside the LiDAR's field of view"),
    "points face back": (turned(points=BACK), "legs and the LiDAR contradict"),
    "points face left": (turned(points=LEFT), "legs and the LiDAR contradict"),
    "imu upside down": (turned(imu=FLIP), "leans by"),
    "imu faces back": (turned(imu=BACK), "leans by"),
    "both upside down": (turned(FLIP, FLIP), "leans by"),
    "both face left": (turned(LEFT, LEFT), "leans by"),
    "imu in g": (scaled(1.0 / 9.81), "in g"),
    "scans of another clock": (shifted(LidarScan, 30.0), "30.00 s ahead of"),
    "scans late": (shifted(LidarScan, -1.8), "1.80 s behind"),
    "imu ahead": (shifted(LidarImu, 1.8), "1.80 s behind"),
    "scans jump": (shifted(LidarScan, 1.8, LATER), "1.80 s ahead of"),
    "scans jump back": (shifted(LidarScan, -1.8, LATER), "1.80 s behind"),
    "imu jumps": (shifted(LidarImu, 1.8, LATER), "1.80 s behind"),
    "imu jumps back": (shifted(LidarImu, -30.0, LATER), "ahead of"),
    "clock jumps back": (shifted((LidarImu, LidarScan), -1.8, LATER), "jumped back by 1.80 s"),
}
RIGHT = {
    "sound": turned(),
    "turned by 5 degrees": turned(*2 * [rotation_rpy(0, 0, 0.087)]),
    "scans 50 ms late": shifted(LidarScan, -0.05),
    "clock jumps": shifted((LidarImu, LidarScan), 30.0, LATER),
}


def walked(change: Change, seconds: float = 5.0) -> tuple[Lio, float]:
    """Return the odometry after a walk, and how far its place is off [m]; infinite where it is lost."""
    odometry, walk = Lio(), MadeWalk(ROOM)
    for tenth in walk.tenths(seconds):
        for reading in tenth:
            give(odometry, change(reading))
    estimate = odometry.estimate()
    if estimate is None:
        return odometry, np.inf
    return odometry, float(np.linalg.norm(estimate.T_odom_base[:3, 3] - [walk.way(seconds), 0.0, 0.0]))


@pytest.mark.parametrize("case", LOST)
def test_what_cannot_be_is_lost_and_says_why(case: str) -> None:
    change, why = LOST[case]
    odometry, off = walked(change)
    assert off == np.inf and why in odometry.why


@pytest.mark.parametrize("case", RIGHT)
def test_what_can_be_is_right(case: str) -> None:
    odometry, off = walked(RIGHT[case])
    assert off < 0.05, odometry.why


def test_a_slope_is_no_contradiction() -> None:
    """The torso's IMU says the same lean, so that is how the robot stands."""
    odometry, walk = Lio(), MadeWalk(ROOM)
    R = rotation_rpy(0.0, 0.3, 0.0)
    for tenth in walk.tenths(1.5):
        for reading in tenth:
            if isinstance(reading, LidarImu):
                B = T_TORSO_LIDAR[:3, :3]
                reading = replace(reading, acc=B.T @ R.T @ B @ reading.acc)
            if isinstance(reading, LegOdometry):
                T = reading.T_odom_base.copy()
                T[:3, :3] = R
                reading = replace(reading, T_odom_base=T)
            give(odometry, reading)
    assert not odometry.why
