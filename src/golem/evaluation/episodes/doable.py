"""Whether a pick could be done at all: which hand reaches a loose screw and the tray, by the simulator's truth."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np

from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.grasping.centroid import grasp_pose
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.evaluation.episodes.pick_claims import Fastener
from golem.types import SIDES, Array, Side

HEADING = np.pi / 2
"""Heading of the gripper's x axis, left hand; mirrored for the right [rad]."""
NEAREST = 10
"""Places above the tray that are tried, those first that are near to where an arm works best."""
TURNS = (0.0, 0.4, -0.4)
"""Turns from it that are tried [rad]."""


@cache
def _tools() -> tuple[GoalPostures, PlanningRobot]:
    return GoalPostures(), PlanningRobot()


def reaches(side: Side, position: Array) -> bool:
    """Return whether a hand that points straight down can be at (3,) `position` in base_link [m].

    It can if a posture within the gate's range is found, from several starts, in which the robot does not touch itself.
    """
    goals, robot = _tools()
    ready = POSTURES["ready"]
    space = JointSpace(robot, ready)
    for turn in TURNS:
        T = grasp_pose(position, (HEADING if side == "left" else -HEADING) + turn)
        left, right = (T if side == one else None for one in SIDES)
        if len(goals.find(left, right, ready, lambda q: space.verdict(q) == 0, most=1)):
            return True
    return False


def doable(fasteners: Sequence[Fastener], drops: Array) -> bool:
    """Return whether a hand reaches a loose screw and a place above the tray.

    Args:
        fasteners: those of the near edge.
        drops: (n, 3) places above the tray in base_link [m].
    """
    loose = [f.in_base for f in fasteners if f.loose]
    for side in SIDES:
        own = 1.0 if side == "left" else -1.0
        near = sorted(drops, key=lambda p: float(np.hypot(p[0] - 0.4, p[1] - own * 0.2)))
        if any(reaches(side, p) for p in near[:NEAREST]) and any(reaches(side, p) for p in loose):
            return True
    return False
