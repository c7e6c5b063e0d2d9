"""Inverse kinematics of one arm for many poses at once: whether a hand can be there, in 0.25 ms each."""

from __future__ import annotations

import numpy as np

from golem.capabilities.arms import ik_kernel
from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS
from golem.types import SIDES, Array, Side

ITERATIONS = 24
INSIDE = 0.002
"""Distance kept from the range that the safety gate allows [rad]: more than a planner keeps."""
TURNS = (0.0, 0.25, -0.25)
"""Turns of the torso that are tried, one after the other, until any of several poses is reached [rad]."""


class QuickIK:
    """Damped least squares (Wampler 1986) on the seven joints of an arm, the torso still, from several starts."""

    def __init__(self) -> None:
        self.kinematics = UpperKinematics()
        self._arms = {side: self._arm(side) for side in SIDES}

    def _arm(self, side: Side) -> tuple[Array, Array, Array, Array, Array]:
        """Return what the kernel takes of an arm: axes, points, the hand at zero, and the range of the joints."""
        k, columns = self.kinematics, ARM_COLUMNS[side]
        return *k.exponentials(side), k.lower[columns] + INSIDE, k.upper[columns] - INSIDE

    def solve(self, side: Side, T: Array, starts: Array, iterations: int = ITERATIONS) -> Array | None:
        """Return the (15,) joints that put the hand at `T` (4, 4), in base_link; None where no start leads there.

        Args:
            T: where the grasp frame is to be.
            starts: (n, 15) joints to begin with, in the order in which they are tried [rad].
            iterations: how many steps each start gets.
        """
        goal, columns = np.ascontiguousarray(T, float), ARM_COLUMNS[side]
        for start in starts:
            arm = np.append(start[0], start[columns])
            if ik_kernel.descend(arm, goal, *self._arms[side], iterations):
                q = np.array(start, dtype=np.float64)
                q[columns] = arm[1:]
                return q
        return None

    def approach(self, side: Side, T: Array, before: float, starts: Array) -> tuple[Array, Array] | None:
        """Return the (15,) joints from which the hand comes and those at `T` (4, 4); None where it does not.

        Args:
            T: where the grasp frame is to be, in base_link.
            before: distance from `T`, along its approach, from which the hand comes [m].
            starts: see `solve`.
        """
        there = T.copy()
        there[:3, 3] -= before * T[:3, 2]
        away = self.solve(side, there, starts)
        at = None if away is None else self.solve(side, T, away[None])
        return None if away is None or at is None else (away, at)
