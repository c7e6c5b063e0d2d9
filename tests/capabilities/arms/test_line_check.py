"""A straight line is tried before the hand moves: it is kept to, or refused with the deviation it would have."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.arms.base import TargetError
from golem.capabilities.arms.line import LineChecker
from golem.capabilities.arms.postures import posture
from golem.capabilities.collision.obstacles import Obstacle, World
from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.types import SIDES, Array, Side

READY = posture("ready")


@pytest.fixture(scope="module")
def checker() -> LineChecker:
    return LineChecker()


def moved(checker: LineChecker, side: Side, *by: float) -> Array:
    T = checker.ik.kinematics.pose(side, READY).copy()
    T[:3, 3] += by
    return T


@pytest.mark.parametrize("side", SIDES)
def test_an_extraction_is_straight_and_along_the_tool(checker: LineChecker, side: Side) -> None:
    line = checker.check(side, moved(checker, side, 0.0, 0.0, 0.06), READY, 0.05)
    assert line.deviation < 0.001 and line.tilt < np.deg2rad(0.5)
    kinematics = checker.ik.kinematics
    start, end = kinematics.pose(side, READY)[:3, 3], kinematics.pose(side, line.q[-1])[:3, 3]
    np.testing.assert_allclose(end - start, [0.0, 0.0, 0.06], atol=1e-3)
    path = np.array([kinematics.pose(side, q)[:2, 3] for q in line.q])
    assert np.abs(path - start[:2]).max() < 0.001


def test_a_line_out_of_reach_is_refused_with_its_deviation(checker: LineChecker) -> None:
    with pytest.raises(PlanRefused, match=r"leave the straight line of 500 mm by \d+\.\d mm .*at a limit: ") as caught:
        checker.check("right", moved(checker, "right", 0.5, 0.0, 0.0), READY, 0.25)
    assert caught.value.refusal is Refusal.OFF_LINE


def test_a_line_into_something_is_refused(checker: LineChecker) -> None:
    T = np.eye(4)
    T[:3, 3] = checker.ik.kinematics.pose("right", READY)[:3, 3] - (0.0, 0.0, 0.15)
    space = JointSpace(PlanningRobot(), READY, World([Obstacle("box", T, (0.2, 0.2, 0.05))]))
    with pytest.raises(PlanRefused, match=r"after \d+ % of it, something is in the way") as caught:
        checker.check("right", moved(checker, "right", 0.0, 0.0, -0.12), READY, 0.2, space=space)
    assert caught.value.refusal is Refusal.NO_PATH


def test_a_goal_that_is_no_pose_is_refused(checker: LineChecker) -> None:
    with pytest.raises(TargetError):
        checker.check("right", np.full((4, 4), np.nan), READY, 0.1)
    with pytest.raises(TargetError):
        checker.check("right", np.eye(4), np.full(15, np.nan), 0.1)


def test_a_line_of_no_length_is_kept_to(checker: LineChecker) -> None:
    assert checker.check("left", moved(checker, "left", 0.0, 0.0, 0.0), READY, 0.1).deviation < 1e-6
