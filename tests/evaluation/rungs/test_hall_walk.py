"""What a judge sees of a walk: standing, recoveries, and walkers that are nobody."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from golem.evaluation.episodes.episode import Episode
from golem.evaluation.rungs.navigate_hall import HallWalk
from golem.interfaces.nav_payloads import NavStep
from golem.types import PlanarPose, Twist

HERE = PlanarPose(0.0, 0.0, 0.0)
AHEAD = Twist(0.3, 0.0, 0.0)


class Walk:
    """Stands in for an episode in whose hall somebody goes 1 m/s along x, 2 m to the left."""

    def __init__(self) -> None:
        self.t, self.step = 0.0, None
        truth = SimpleNamespace(T_world_odom=np.eye(4), pose=lambda: HERE)
        person = SimpleNamespace(position=lambda t: np.array([t, 2.0, 0.0]))
        self.robot = SimpleNamespace(truth=truth, scene=SimpleNamespace(people=(person,)))
        self.running = SimpleNamespace(bus=SimpleNamespace(latest=lambda topic: self.step))

    def says(self, watch: HallWalk, t: float, note: str, twist: Twist, *people: tuple[float, float]) -> None:
        rows = np.array([(x, y, 0.0, 0.0, 0.3) for x, y in people]).reshape(-1, 5)
        self.step: Any = NavStep(twist, False, HERE, note=note, people=rows)
        for later in (0.0, 0.002):
            self.t = t + later
            watch(cast(Episode, self))


def test_walkers_are_counted_where_somebody_is_and_where_nobody_is() -> None:
    walk, watch = Walk(), HallWalk()
    walk.says(watch, 1.0, "follow", AHEAD, (1.1, 2.2))
    walk.says(watch, 2.0, "follow", AHEAD, (2.0, 1.8), (2.0, 0.0))
    walk.says(watch, 3.0, "follow", AHEAD, (1.0, 2.0))
    assert (watch.walkers, watch.nobody) == (4, 2)
    assert watch.series()["nobody"] == pytest.approx(0.5)


def test_without_walkers_there_is_no_share_of_them() -> None:
    walk, watch = Walk(), HallWalk()
    walk.says(watch, 1.0, "follow", AHEAD)
    assert "nobody" not in watch.series()


def test_time_at_a_stand_and_recoveries_are_counted() -> None:
    walk, watch = Walk(), HallWalk()
    for t, note, twist in (
        (1.0, "follow", AHEAD),
        (2.0, "blocked", Twist()),
        (3.0, "recover", Twist()),
        (3.5, "recover", Twist()),
        (4.0, "approach", AHEAD),
        (6.0, "approach", Twist()),
    ):
        walk.says(watch, t, note, twist)
    assert watch.series() == {"recoveries": 1.0, "stood": pytest.approx(2.0)}
    assert watch.stopped is not None and len(watch.track) > 1
