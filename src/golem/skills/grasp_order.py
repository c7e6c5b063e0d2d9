"""In which order a skill tries what was proposed: first what an arm reaches, which is asked in milliseconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.quick_ik import TURNS, QuickIK
from golem.capabilities.grasping.base import Grasp
from golem.skills.context import Context
from golem.types import Side


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
        return ik.approach(side, T @ grasp.T_odom_gripper, before, starts) is not None

    for turn in TURNS:
        starts[:, 0] = q[0] + turn
        found = [reached(grasp) for grasp in grasps]
        if any(found):
            order = sorted(range(len(grasps)), key=lambda k: not found[k])
            return [grasps[k] for k in order]
    return list(grasps)
