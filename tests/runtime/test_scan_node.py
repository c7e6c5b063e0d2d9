"""Scans are posed where they were taken; what belongs to another clock, is frozen or broken never gets through."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.evaluation.conformance.room import HEIGHT, ROOM, MadeWalk
from golem.interfaces import topics
from golem.interfaces.lidar import LidarScan
from golem.interfaces.nav_payloads import Scan
from golem.interfaces.payloads import Odometry
from golem.middleware.bus import Bus
from golem.robots.model.spatial import transform
from golem.runtime.odometry_node import ScanNode


class Rig:
    """A robot that walks through a room, its odometry right."""

    def __init__(self) -> None:
        self.walk, self.rng = MadeWalk(ROOM, still=0.0), np.random.default_rng(0)
        self.bus = Bus()
        self.node = ScanNode(self.bus)
        self.t = 0.0

    def run(self, seconds: float) -> None:
        end = self.t + seconds
        while self.t < end - 1e-9:
            self.t = round(self.t + 0.01, 6)
            T = transform((self.walk.way(self.t), 0.0, 0.0))
            self.bus.publish(topics.ODOMETRY, Odometry(self.t, T, self.walk.T_base_lidar), self.t)
            self.node.step(self.t)

    def scan(self, t: float | None = None) -> LidarScan:
        return self.walk.scan(self.t if t is None else t, self.rng)

    def give(self, scan: LidarScan) -> Scan | None:
        count = self.bus.count(topics.SCAN)
        self.bus.publish(topics.LIDAR_SCAN, scan, self.t)
        self.node.step(self.t)
        return self.bus.latest(topics.SCAN) if self.bus.count(topics.SCAN) > count else None


@pytest.fixture
def rig() -> Rig:
    rig = Rig()
    rig.run(2.0)
    return rig


def test_points_lie_on_the_walls_while_the_robot_walks(rig: Rig) -> None:
    posed = rig.give(rig.scan())
    assert posed is not None
    faces = np.abs(posed.points[:, :, None] - ROOM).min(axis=2).min(axis=1)
    assert np.quantile(faces, 0.95) < 0.06
    assert posed.floor[2] == pytest.approx(-HEIGHT, abs=0.01) and np.abs(posed.floor[:2]).max() < 0.005
    assert np.median(posed.heights[posed.points[:, 2] < -0.9]) == pytest.approx(0.0, abs=0.02)


def test_a_scan_of_another_clock_is_left_out(rig: Rig) -> None:
    scan = rig.scan()
    for t in (scan.t + 1e6, scan.t - 1e3, float("nan")):
        assert rig.give(replace(scan, t=t)) is None
    assert rig.give(scan) is not None


def test_a_sensor_that_repeats_itself_is_not_believed(rig: Rig) -> None:
    scan = rig.scan()
    assert rig.give(scan) is not None
    rig.run(0.1)
    assert rig.give(replace(scan, t=rig.t)) is None
    assert rig.give(rig.scan()) is not None


def test_points_that_are_none_are_left_out(rig: Rig) -> None:
    scan = rig.scan()
    points = scan.points.copy()
    points[::3] = np.nan
    posed = rig.give(replace(scan, points=points))
    assert posed is not None and np.isfinite(posed.points).all()
    assert rig.give(replace(rig.scan(), points=np.full_like(points, np.nan))) is None


def test_an_odometry_that_falls_silent_leaves_scans_without_a_place(rig: Rig) -> None:
    rig.t += 1.0
    assert rig.give(rig.scan()) is None


def test_a_scan_seen_from_another_frame_is_the_same_scan(rig: Rig) -> None:
    from golem.types import PlanarPose

    posed = rig.give(rig.scan())
    assert posed is not None
    moved = posed.seen_from(PlanarPose(1.0, -2.0, 0.7))
    assert np.abs(moved.heights - posed.heights).max() < 1e-9
    back = moved.seen_from(PlanarPose(1.0, -2.0, 0.7).to(PlanarPose(0.0, 0.0, 0.0)))
    assert np.abs(back.points - posed.points).max() < 1e-9 and np.abs(back.floor - posed.floor).max() < 1e-9
