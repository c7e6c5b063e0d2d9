"""Closes and opens a hand, and feels what it meets: what is screwed down is let go, and nothing is pressed on."""

from __future__ import annotations

from collections import deque

import numpy as np

from golem.capabilities.arms.hand_force import HandForce
from golem.interfaces import topics
from golem.interfaces.payloads import GripState
from golem.skills.base import StageFailed
from golem.skills.context import Context
from golem.types import UPPER, Array, Side

CLOSED = (GripState.HOLDING, GripState.EMPTY)
"""States of a hand whose fingers have closed, on something or on nothing."""
HEARD = 0.06
"""Time in which a hand begins what it was told [s]."""
PATIENCE = 2.5
"""Time the fingers may take [s]."""
OPENS = 0.005
"""Fingers that open go apart by so much, at the least [m]."""


class KeptGrip:
    """Minds what a hand carries, as `Context.minding` calls it: closes again on what slides, and ends what was lost."""

    def __init__(self, context: Context, side: Side, force: float, thing: str) -> None:
        """Mind `thing` in the hand of a `side`, held with `force` [N]."""
        self._context, self._force, self._thing = context, force, thing
        self._side: Side = side
        self._since: float | None = None

    def __call__(self) -> None:
        """Look at the hand. Raises StageFailed: it has closed again, and holds nothing."""
        hand, now = self._context.hands[self._side], self._context.t
        if hand.status.holding:
            self._since = None
        elif self._since is None:
            self._since = now
            self._context.say("carry", f"The {self._thing} slides in the fingers. Gripping again.")
            hand.close(self._force)
        elif now - self._since > (HEARD if hand.status.state is GripState.EMPTY else PATIENCE):
            x, y = self._context.arms[self._side].pose[:2, 3]
            raise StageFailed(
                "carry", "grasp_method", f"The {self._thing} was lost on the way, near ({x:.2f}, {y:.2f}) in odom."
            )


async def close_hand(context: Context, side: Side, force: float, patience: float = PATIENCE) -> bool:
    """Close a hand with `force` of each finger [N]; return whether it holds something, after `patience` [s] at most.

    A hand that noticed a slip keeps pressing, and no longer says that it holds: what slid between its fingers and is
    still there is found by closing again.
    """
    hand = context.hands[side]
    hand.close(force)
    await context.sleep(HEARD)
    await context.until(lambda: hand.status.state in CLOSED, patience)
    return hand.status.holding


async def open_hand(context: Context, side: Side, gap: float, stage: str) -> None:
    """Let go of what a hand holds, its fingers `gap` [m] apart. Raises StageFailed, of `stage`: they do not open."""
    hand, before = context.hands[side], context.hands[side].status.gap
    hand.open(gap)
    opened = await context.until(lambda: hand.status.state is GripState.OPEN, PATIENCE)
    if not opened and hand.status.gap < min(before + OPENS, gap - OPENS):
        raise StageFailed(stage, "hand", f"The {side} hand does not open (gap {1e3 * hand.status.gap:.0f} mm).")


TICKS = 5
"""Ticks over which the force is averaged: the torques of one tick are off by 2 to 3 N at the hand."""
REST = 10
"""Ticks at rest over which the force before the motion is averaged."""
LEADING = 3.0
"""So many times the force may be met on the way on which the arm's own is learned."""
STILL = 0.001
"""What goes further than this within `TICKS` is not held [m]: its force is that of the arm's own acceleration."""


class ForceGuard:
    """Ask it every tick of a motion whether the hand meets more force than it should, and goes no further.

    Attributes:
        stuck: whether it did.
        largest: largest force of the hand along the motion while it was asked, averaged over `TICKS` [N].
    """

    def __init__(
        self, context: Context, side: Side, axis: Array, force: float, length: float = np.inf, lead: float = 0.0
    ) -> None:
        """Begin where the hand is now; see `at_rest`."""
        self._context, self._axis = context, axis
        self._side: Side = side
        self._force, self._length, self._lead = force, length, lead
        self._feel = HandForce()
        self._start = context.arms[side].commanded[:3, 3].copy()
        self._before = self._along()
        self._last: deque[tuple[float, float]] = deque(maxlen=TICKS)
        self._own: deque[float] = deque(maxlen=5 * REST)
        self.stuck = False
        self.largest = 0.0

    @classmethod
    async def at_rest(
        cls, context: Context, side: Side, axis: Array, force: float, length: float = np.inf, lead: float = 0.0
    ) -> ForceGuard:
        """Return a guard of a hand that is at rest now, after having felt for `REST` ticks what is there before.

        Args:
            axis: (3,) direction of the motion in odom, of unit length.
            force: what it may meet [N].
            length: way of the commanded pose along the axis after which nothing more is asked [m].
            lead: way at first over which it learns what the arm takes for itself [m]: friction turns round as it
                begins to move, 7 to 10 N at the hand. Until there it may meet `LEADING` times as much.
        """
        guard, before = cls(context, side, axis, force, length, lead), list[float]()
        for _ in range(REST):
            await context.tick()
            before.append(guard._along())
        guard._before = float(np.mean(before))
        return guard

    def __call__(self) -> bool:
        """Return whether it does, or did."""
        arm = self._context.arms[self._side]
        gone = float((arm.commanded[:3, 3] - self._start) @ self._axis)
        if not self.stuck and gone <= self._length:
            if self._own and gone >= self._lead:
                # What comes now is measured against what it took to get here.
                self._before += float(np.mean(self._own))
                self._own.clear()
                self._last.clear()
            self._last.append((self._along() - self._before, float(arm.pose[:3, 3] @ self._axis)))
            if len(self._last) == TICKS:
                force = float(np.mean([f for f, _ in self._last]))
                self.largest = max(self.largest, force)
                limit = self._force
                if gone < self._lead:
                    self._own.append(force)
                    limit *= LEADING
                self.stuck = force > limit and self._last[-1][1] - self._last[0][1] < STILL
        return self.stuck

    def _along(self) -> float:
        """Return the force of the hand along the axis [N]; 0 while the motors do not report."""
        state = self._context.bus.latest(topics.LOW_STATE)
        if state is None:
            return 0.0
        force = self._feel(self._side, state.q[UPPER], state.tau[UPPER])
        return float(np.dot(self._context.T_odom_base[:3, :3] @ force, self._axis))
