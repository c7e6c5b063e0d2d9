"""In which order a skill tries what was proposed: first what an arm reaches, which is asked in milliseconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.quick_ik import QuickIK
from golem.capabilities.grasping.base import Grasp
from golem.skills.context import Context
from golem.skills.poses import retracted
from golem.types import Side

TURNS = (0.0, 0.25, -0.25)
"""Turns of the torso that are tried, one after the other, until any grasp is reached [rad]."""


def reached_first(context: Context, side: Side, grasps: Sequence[Grasp], before: float) -> list[Grasp]:
    """Return the same `grasps`, first those that an arm reaches with the least turn of the torso.

    Args:
        context: where the arms are.
        side: which hand.
        grasps: best first.
        before: distance from a grasp, along its approach, from which the hand comes [m].
    """
    ik, q = QuickIK(), context.commanded_joints
    T = np.linalg.inv(context.T_odom_base)
    starts = np.array([q, posture(f"ready_{side}"), posture(f"forward_{side}")])

    def reached(grasp: Grasp) -> bool:
        there = T @ grasp.T_odom_gripper
        away = ik.solve(side, retracted(there, before), starts)
        return away is not None and ik.solve(side, there, away[None]) is not None

    for turn in TURNS:
        starts[:, 0] = q[0] + turn
        found = [reached(grasp) for grasp in grasps]
        if any(found):
            order = sorted(range(len(grasps)), key=lambda k: not found[k])
            return [grasps[k] for k in order]
    return list(grasps)
