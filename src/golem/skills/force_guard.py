"""Feels what a hand meets: what is screwed down is let go before it is torn at, and nothing is pressed on."""

from __future__ import annotations

import numpy as np

from golem.capabilities.arms.hand_force import HandForce
from golem.interfaces import topics
from golem.skills.context import Context
from golem.types import UPPER, Array, Side

TICKS = 3
"""Ticks in a row that a force has to last: one alone is a jerk of the arm."""


class ForceGuard:
    """Ask it every tick of a motion whether the hand meets more force than it should.

    Attributes:
        stuck: whether it did.
        largest: largest force of the hand along the motion while it was asked [N].
    """

    def __init__(
        self, context: Context, side: Side, axis: Array, force: float, length: float = np.inf
    ) -> None:
        """Begin where the hand is now, which should be at rest.

        Args:
            context: whose hand.
            side: which.
            axis: (3,) direction of the motion in odom, of unit length.
            force: what it may meet [N].
            length: way of the commanded pose along the axis after which nothing more is asked [m].
        """
        self._context, self._axis = context, axis
        self._side: Side = side
        self._force, self._length = force, length
        self._feel = HandForce()
        self._start = context.arms[side].commanded[:3, 3].copy()
        self._before = self._along()
        self._ticks = 0
        self.stuck = False
        self.largest = 0.0

    def __call__(self) -> bool:
        """Return whether it does, or did."""
        gone = float((self._context.arms[self._side].commanded[:3, 3] - self._start) @ self._axis)
        if not self.stuck and gone <= self._length:
            force = self._along() - self._before
            self.largest = max(self.largest, force)
            self._ticks = self._ticks + 1 if force > self._force else 0
            self.stuck = self._ticks >= TICKS
        return self.stuck

    def _along(self) -> float:
        """Return the force of the hand along the axis [N]; 0 while the motors do not report."""
        state = self._context.bus.latest(topics.LOW_STATE)
        if state is None:
            return 0.0
        force = self._feel(self._side, state.q[UPPER], state.tau[UPPER])
        return float(np.dot(self._context.T_odom_base[:3, :3] @ force, self._axis))
