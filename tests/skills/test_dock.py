"""Docking with a base that follows every twist exactly, before a pack that it sees by scans."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest
from tests.skills.test_walk import Ground, outcome

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import Scan
from golem.skills.dock import Dock, DockGoal
from golem.types import PlanarPose, Twist


@dataclass
class Before(Ground):
    """A robot before a pack, 1.2 m deep and 2 m wide, whose near edge has its middle at `pack`."""

    pack: PlanarPose | None = field(default_factory=lambda: PlanarPose(1.0, 0.15, 0.1))

    def _advance(self) -> None:
        super()._advance()
        t = self.context.t
        if self.pack is None or round(t * 100) % 10:
            return
        rng = np.random.default_rng(round(t * 100))
        top = rng.uniform((0.0, -1.0), (1.2, 1.0), (600, 2)) * ([[0.0, 1.0]] * 200 + [[1.0, 1.0]] * 400)
        c, s = math.cos(self.pack.yaw), math.sin(self.pack.yaw)
        places = top @ np.array([[c, s], [-s, c]]) + (self.pack.x, self.pack.y)
        points = np.column_stack([places + 0.01 * rng.standard_normal((600, 2)), rng.uniform(-0.12, 0.05, 600)])
        self.bus.publish(topics.SCAN, Scan(t, points, np.zeros(3), np.array([0.0, 0.0, -1.0])), t)


@pytest.mark.parametrize("lateral", [0.0, 0.2])
def test_it_stands_at_its_stance_before_the_edge(lateral: float) -> None:
    robot = Before()
    goal = DockGoal(standoff=0.45, lateral=lateral)
    result = outcome(robot.run(Dock().run(robot.context, goal)))
    assert result.success and robot.twist == Twist()
    assert robot.pack is not None
    off = (robot.pack @ PlanarPose(-0.45, lateral, 0.0)).to(robot.pose)
    assert abs(off.x) < 0.04 and abs(off.y) < 0.09 and abs(off.yaw) < 0.06
    assert set(robot.stages) == {"look", "approach"}


def test_a_pack_that_is_not_there_or_too_far_is_said() -> None:
    robot = Before(pack=None)
    result = outcome(robot.run(Dock().run(robot.context, DockGoal())))
    assert (result.success, result.stage) == (False, "look") and "No scan" in result.reason
    robot = Before(pack=PlanarPose(2.3, 0.0, 0.0))
    result = outcome(robot.run(Dock().run(robot.context, DockGoal())))
    assert not result.success and "navigate nearer" in result.reason and robot.twist == Twist()


def test_cancelled_on_its_way_it_stands() -> None:
    robot = Before(PlanarPose(0.0, -0.4, 0.0))
    run = robot.run(Dock().run(robot.context, DockGoal()), 4.0)
    assert run.result is None and robot.twist != Twist()
    run.cancel()
    run.step()
    assert run.result is not None and robot.twist == Twist()


@pytest.mark.parametrize("at", [0.05, 0.8, 2.0, 9.0])
def test_cancelled_at_any_stage_it_stands_and_stays(at: float) -> None:
    robot = Before(PlanarPose(0.0, -0.4, 0.0))
    run = robot.run(Dock().run(robot.context, DockGoal()), at)
    assert run.result is None
    run.cancel()
    for _ in range(100):
        robot._advance()
        run.step()
        robot.node.step(robot.context.t)
    place = robot.pose
    assert run.result is not None and run.result.stage == "cancelled"
    for _ in range(50):
        robot._advance()
        robot.node.step(robot.context.t)
    assert robot.twist == Twist() and robot.pose == place


def test_wrong_goals_are_refused() -> None:
    with pytest.raises(ConfigError, match="standoff"):
        DockGoal(standoff=0.1)
