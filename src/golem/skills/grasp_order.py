"""In which order a skill tries what was proposed: first what the arm alone reaches, which is asked in milliseconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.quick_ik import QuickIK
from golem.capabilities.grasping.base import Grasp
from golem.skills.context import Context
from golem.skills.poses import retracted
from golem.types import Side


def reached_first(context: Context, side: Side, grasps: Sequence[Grasp], before: float) -> list[Grasp]:
    """Return the same `grasps`, those first that an arm reaches without the torso, else in their order.

    Args:
        context: where the arms are.
        side: which hand.
        grasps: best first.
        before: distance from a grasp, along its approach, from which the hand comes [m].
    """
    ik, q = QuickIK(), context.commanded_joints
    T = np.linalg.inv(context.T_odom_base)
    starts = np.array([q, posture(f"ready_{side}"), posture(f"forward_{side}")])
    starts[:, 0] = q[0]

    def reached(grasp: Grasp) -> bool:
        there = T @ grasp.T_odom_gripper
        away = ik.solve(side, retracted(there, before), starts)
        return away is not None and ik.solve(side, there, away[None]) is not None

    return sorted(grasps, key=lambda grasp: not reached(grasp))
