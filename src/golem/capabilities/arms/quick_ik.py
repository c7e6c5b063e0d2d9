"""Inverse kinematics of one arm for many poses at once: whether a hand can be there, in about a millisecond each."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS
from golem.types import Array, Side

ITERATIONS = 24
DAMPING = 0.03
"""Damping of the least squares [m and rad mixed]."""
STEP = 0.35
"""Largest change of a joint in an iteration [rad]."""
INSIDE = 0.002
"""Distance kept from the range that the safety gate allows [rad]: more than a planner keeps."""
POSITION, ROTATION = 0.001, 0.01
"""Distance [m] and angle [rad] from a pose that count as there."""


class QuickIK:
    """Damped least squares (Wampler 1986) on the seven joints of an arm, the torso still, from several starts.

    Attributes:
        kinematics: the model it works on.
    """

    def __init__(self) -> None:
        """Build the model."""
        self.kinematics = UpperKinematics()

    def solve(self, side: Side, T: Array, starts: Array, iterations: int = ITERATIONS) -> Array | None:
        """Return the (15,) joints that put the hand at `T` (4, 4), in base_link; None where no start leads there.

        Args:
            side: which hand.
            T: where the grasp frame is to be.
            starts: (n, 15) joints to begin with, in the order in which they are tried [rad].
            iterations: how many steps each start gets.
        """
        goal = pin.SE3(T[:3, :3], T[:3, 3])
        for start in starts:
            q = self._descend(side, goal, start, iterations)
            if q is not None:
                return q
        return None

    def _descend(self, side: Side, goal: pin.SE3, start: Array, iterations: int) -> Array | None:
        k, columns = self.kinematics, ARM_COLUMNS[side]
        lower, upper = k.lower[columns] + INSIDE, k.upper[columns] - INSIDE
        q = np.array(start, dtype=np.float64)
        damping = DAMPING**2 * np.eye(6)
        last = np.inf
        for i in range(iterations + 1):
            pin.computeJointJacobians(k.model, k.data, q)
            pin.updateFramePlacement(k.model, k.data, k.frame[side])
            error = pin.log6(k.placement(side).actInv(goal)).vector
            away = float(np.linalg.norm(error[:3])) + 0.1 * float(np.linalg.norm(error[3:]))
            if np.linalg.norm(error[:3]) < POSITION and np.linalg.norm(error[3:]) < ROTATION:
                return q
            # What has hardly moved in eight steps is at its limits.
            if i % 8 == 7:
                if away > 0.7 * last:
                    return None
                last = away
            J = k.jacobian(side)[:, columns]
            step = J.T @ np.linalg.solve(J @ J.T + damping * min(1.0, away), error)
            step *= min(1.0, STEP / max(float(np.abs(step).max()), 1e-12))
            q[columns] = np.clip(q[columns] + step, lower, upper)
        return None
