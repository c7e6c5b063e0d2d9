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
        self._arm = UpperKinematics()

    def __call__(self, side: Side, q: Array, tau: Array) -> Array:
        """Return the (3,) force that a hand exerts on what it touches, in base_link [N].

        Args:
            q: (15,) joints of torso, left arm, right arm [rad].
            tau: (15,) their torques [N m].
        """
        wrench = self.wrench(side, q, tau)
        return np.asarray(self._arm.placement(side).rotation @ wrench[:3], dtype=np.float64)

    def covariance(self, side: Side, q: Array) -> Array:
        """Return the (6, 6) covariance of `wrench`, in its frame, by the two standard deviations above."""
        self._arm.update(q)
        J = self._arm.jacobian(side)[:, ARM_COLUMNS[side]]
        information = J @ J.T + np.diag((TORQUE / WRENCH) ** 2)
        return np.asarray(TORQUE**2 * np.linalg.inv(information), dtype=np.float64)

    def wrench(self, side: Side, q: Array, tau: Array) -> Array:
        """Return the (6,) force [N] and moment [N m] of a hand on what it touches, in its grasp frame."""
        arm, columns = self._arm, ARM_COLUMNS[side]
        rest = tau - pin.computeGeneralizedGravity(arm.model, arm.data, q)
        arm.update(q)
        J = arm.jacobian(side)[:, columns]
        likely = J @ J.T + np.diag((TORQUE / WRENCH) ** 2)
        return np.linalg.solve(likely, J @ rest[columns])


QUICK, SLOW = 0.012, 0.6
"""Time constants of what is felt now, and of what was there before [s] [own: one tick is off by 2 to 3 N]."""
HELD = 6.0
"""Time constant with which what stays becomes what was there before: a load, or stiffness after a start [s] [own]."""
TOUCH, LEFT = 2.2, 1.2
"""Change of the force from which on something touches a hand, and below which nothing does any more [N]."""
MOTION = 12.0
"""How much more it takes of an arm that moves, by the speed of its fastest joint [N s/rad]: friction and inertia."""


class ContactSense:
    """Tells when something touches a hand: when its force changes by more than motion and noise explain.

    Attributes:
        touching: whether something does.
        change: (6,) the wrench of the hand on the world since before the touch, in its grasp frame [N, N m].
    """

    def __init__(self, side: Side) -> None:
        self._side: Side = side
        self._feel = HandForce()
        self._quick: Array | None = None
        self._slow, self._speed, self._t = np.zeros(6), np.zeros(7), 0.0
        self.touching, self.change = False, np.zeros(6)

    def step(self, t: float, q: Array, dq: Array, tau: Array) -> bool:
        """Feel at time `t` [s] with (15,) joints [rad], their speeds and torques; return whether `touching` changed."""
        wrench, dt = self._feel.wrench(self._side, q, tau), t - self._t
        self._t = t
        if self._quick is None or not 0.0 < dt < SLOW:
            self._quick, self._slow, self._speed = wrench, wrench, np.zeros(7)
            return False
        self._quick = self._quick + min(1.0, dt / QUICK) * (wrench - self._quick)
        self.change = self._quick - self._slow
        force, before = float(np.linalg.norm(self.change[:3])), self.touching
        self._speed = self._speed + min(1.0, dt / QUICK) * (dq[ARM_COLUMNS[self._side]] - self._speed)
        margin = MOTION * float(np.abs(self._speed).max())
        self.touching = force > (LEFT if before else TOUCH) + margin
        constant = HELD if self.touching else SLOW
        self._slow = self._slow + min(1.0, dt / constant) * (self._quick - self._slow)
        return self.touching != before
