"""The robot walks through the hall, and its LiDAR breaks: it stands, and the result says what is missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.interfaces import topics
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.runtime.lockstep import LockstepRunner, build
from golem.stack import load_stack
from golem.types import Twist

Heard = tuple[Sequence[LidarImu], LidarScan | None]
Fault = Callable[[Sequence[LidarImu], LidarScan | None, LidarScan], Heard]
START, AT = 3.0, 3.0
"""When it sets out, and how much later the LiDAR breaks [s]."""

FAULTS: dict[str, tuple[Fault, str]] = {
    "no scan": (lambda samples, scan, last: (samples, None), "No scan has fitted the map"),
    "a frozen scan": (
        lambda samples, scan, last: (samples, scan and replace(last, t=scan.t)),
        "No scan has fitted the map",
    ),
    "points without numbers": (
        lambda samples, scan, last: (samples, scan and replace(scan, points=scan.points * np.float32(np.nan))),
        "No scan has fitted the map",
    ),
    "another clock": (
        lambda samples, scan, last: (samples, scan and replace(scan, t=scan.t + 1e6)),
        "they are of two clocks",
    ),
    "silence": (lambda samples, scan, last: ((), None), "Its sensors have fallen silent."),
}


class Broken:
    """A robot in the hall whose LiDAR breaks at a time."""

    def __init__(self, fault: Fault, at: float = START + AT) -> None:
        self.running, self.robot = build(load_stack("hall", profile="bench"), 0)
        self._lidar, self._last = self.robot.lidar, None
        self._fault, self._at = fault, at
        self.robot.lidar = self.lidar

    def lidar(self, t: float) -> Heard:
        samples, scan = self._lidar(t)
        if t >= self._at:
            return self._fault(samples, scan, self._last or scan)
        self._last = scan or self._last
        return samples, scan

    def close(self) -> None:
        self.robot.close()


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("what", FAULTS)
def test_a_lidar_that_breaks_on_the_way_stops_the_robot_with_the_reason(what: str) -> None:
    fault, words = FAULTS[what]
    with closing(Broken(fault)) as broken:
        running = broken.running
        running.executor.run(START)
        result = running.execute("navigate", {"x": 5.0, "frame": "base_link"})
        assert (result.success, result.slot) == (False, "odometry") and words in result.reason
        assert running.executor.t < START + AT + 6.5
        stands(running, broken.robot)


def stands(running: LockstepRunner, robot: Any) -> None:
    """Check that a robot comes to a stand, and stays."""
    running.executor.run(running.executor.t + 2.0)
    before = robot.data.qpos[:2].copy()
    running.executor.run(running.executor.t + 1.0)
    assert np.linalg.norm(robot.data.qpos[:2] - before) < 0.03
    assert running.bus.latest(topics.TWIST) == Twist()
    assert robot.data.qpos[2] > 0.85


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_half_of_the_points_suffice() -> None:
    def half(samples: Sequence[LidarImu], scan: LidarScan | None, last: LidarScan) -> Heard:
        if scan is None:
            return samples, None
        points = scan.points.copy()
        points[::2] = np.nan
        return samples, replace(scan, points=points)

    with closing(Broken(half)) as broken:
        broken.running.executor.run(START)
        result = broken.running.execute("navigate", {"x": 0.9, "frame": "base_link"})
        assert result.success, result.reason


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_lidar_that_never_speaks_is_named_before_a_step() -> None:
    with closing(Broken(FAULTS["silence"][0], at=0.0)) as broken:
        result = broken.running.execute("navigate", {"x": 3.0, "frame": "base_link"})
        assert (result.success, result.stage, result.slot) == (False, "locate", "odometry")
        assert "waits for the LiDAR's IMU" in result.reason
        assert broken.running.bus.latest(topics.TWIST) == Twist()
