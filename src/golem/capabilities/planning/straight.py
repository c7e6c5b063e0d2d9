"""The straight line in the joints, or nothing: what planners are measured against."""

from __future__ import annotations

import numpy as np

from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.capabilities.planning.joint_space import JointSpace
from golem.capabilities.planning.path_planner import FINE, Effort, PathPlanner
from golem.types import Array


class Straight(PathPlanner):
    """Goes straight to the first goal that it can go straight to."""

    def find(
        self, space: JointSpace, q: Array, goals: Array, rng: np.random.Generator, effort: Effort, attempt: int
    ) -> Array:
        """Return start and goal; see `PathPlanner`."""
        line = straight_line(space, q, goals, effort, FINE)
        if line is None:
            raise PlanRefused(Refusal.NO_PATH, "Something is in the way of a straight line to every goal.")
        return line


def straight_line(space: JointSpace, q: Array, goals: Array, effort: Effort, step: float) -> Array | None:
    """Return the corners (2, 15) of the straight line to the nearest goal that has a free one, or None.

    Args:
        space: what is free.
        q: (15,) start.
        goals: (k, 15).
        effort: what may be spent.
        step: between two checks [rad in a joint].
    """
    for i in np.argsort(np.abs(goals - q).max(axis=1), kind="stable"):
        if effort.left <= 0:
            return None
        effort.spend(int(np.abs(goals[i] - q).max() / step) + 1)
        if space.verdict(goals[i]) == 0 and space.free_line(q, goals[i], step):
            return np.array([q, goals[i]])
    return None
