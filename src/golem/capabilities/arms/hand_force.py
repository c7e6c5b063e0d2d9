"""What a hand presses or pulls with, from the torques that its motors report."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS
from golem.types import Array, Side

TORQUE = 0.5
"""Standard deviation of what a motor's torque is off by: friction, masses, encoder zeros [N m] [own]."""
WRENCH: Array = np.repeat([30.0, 0.6], 3)
"""Standard deviations of force and moment that a hand meets [N, N m] [own]: fingers touch things 2 cm from its grasp
frame. Without them an arm that can hardly resist some moment has the errors of its torques taken for a large one, and
for the force that goes with it."""


class HandForce:
    """Estimates the force at a grasp frame of an arm that moves slowly.

    What the motors do beyond carrying the arm is done at the hand: tau - g(q) = J(q)^T F, the most likely F for
    independent normal errors of `TORQUE` and a wrench of `WRENCH`. Errors of the masses, friction and what is held
    remain in it; the difference to a moment before has them cancelled.
    """

    def __init__(self) -> None:
        """Build the arm's model."""
        self._arm = UpperKinematics()

    def __call__(self, side: Side, q: Array, tau: Array) -> Array:
        """Return the (3,) force that a hand exerts on what it touches, in base_link [N].

        Args:
            side: which hand.
            q: (15,) joints of torso, left arm, right arm [rad].
            tau: (15,) their torques [N m].
        """
        wrench = self.wrench(side, q, tau)
        return np.asarray(self._arm.placement(side).rotation @ wrench[:3], dtype=np.float64)

    def wrench(self, side: Side, q: Array, tau: Array) -> Array:
        """Return the (6,) force [N] and moment [N m] of a hand on what it touches, in its grasp frame."""
        arm, columns = self._arm, ARM_COLUMNS[side]
        rest = tau - pin.computeGeneralizedGravity(arm.model, arm.data, q)
        arm.update(q)
        J = arm.jacobian(side)[:, columns]
        likely = J @ J.T + np.diag((TORQUE / WRENCH) ** 2)
        return np.linalg.solve(likely, J @ rest[columns])
