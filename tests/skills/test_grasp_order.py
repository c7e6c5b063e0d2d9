"""Grasps that the arm alone reaches are tried first."""

from __future__ import annotations

from typing import Any, cast

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.grasping.base import Grasp
from golem.capabilities.grasping.centroid import grasp_pose
from golem.skills.context import Context
from golem.skills.take import reached_first
from golem.types import Array, Side


class Standing:
    """What is asked of a context: a robot that stands in odom, arms ready."""

    T_odom_base: Array = np.eye(4)
    commanded_joints: Array = posture("ready")


def down(x: float, y: float, score: float) -> Grasp:
    return Grasp(grasp_pose(np.array([x, y, 0.0]), -np.pi / 2, np.array([0.0, 0.0, 1.0])), 0.06, score)


def order(side: Side, *grasps: Grasp) -> list[float]:
    context = cast(Context, cast(Any, Standing()))
    return [grasp.score for grasp in reached_first(context, side, grasps, 0.1)]


def test_what_is_out_of_reach_comes_last_and_the_rest_keeps_its_order() -> None:
    best, near, next_one = down(0.9, -0.2, 3.0), down(0.42, -0.15, 2.0), down(0.45, -0.2, 1.0)
    assert order("right", best, near, next_one) == [2.0, 1.0, 3.0]


def test_each_hand_has_its_own_reach() -> None:
    left, right = down(0.42, 0.35, 2.0), down(0.42, -0.35, 1.0)
    assert order("right", left, right) == [1.0, 2.0]
    assert order("left", left, right) == [2.0, 1.0]


def test_nothing_is_left_out() -> None:
    assert order("right") == []
    assert len(order("right", down(2.0, 0.0, 2.0), down(3.0, 0.0, 1.0))) == 2
