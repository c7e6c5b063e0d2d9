"""Controller of one MAGPIE hand: closes with bounded force, detects contact, checks the grip.

After DeliGrasp (Xie et al., 2024): the fingers close at servo speed under a force ceiling, and contact is when both
report half of it. The hand's servos hold a force by themselves (the torque limit of a position-controlled AX-12A), so
nothing here is a force loop.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.interfaces.payloads import GripState, HandStatus
from golem.robots.model.magpie_model import MAX_FORCE, MAX_GAP, MIN_FORCE
from golem.types import HandCommand, HandState

FORCE_STEP = 0.04
"""Resolution of one finger's force [N]: 0.08 N for the pair (paper)."""


def clamp_force(force: float) -> float:
    """Return the nearest force of one finger [N] the servo can be told; the weakest if `force` is not finite."""
    if not math.isfinite(force):
        return MIN_FORCE
    steps = round((min(max(force, MIN_FORCE), MAX_FORCE) - MIN_FORCE) / FORCE_STEP)
    return min(MIN_FORCE + steps * FORCE_STEP, MAX_FORCE)


@dataclass(frozen=True, slots=True)
class MagpieConfig:
    """Options of `MagpieHand`.

    Attributes:
        contact_share: share of the commanded force both fingers must report for contact [DeliGrasp].
        min_contact: force that is no contact yet [N]; the servo's load reads up to 0.25 N without one.
        closed_gap: gap below which nothing can be between the pads [m].
        rest_band: how far the gap may wander at rest [m]; one servo tick moves it by up to 0.23 mm.
        settle: how long it must stay within `rest_band` to be at rest [s].
        slip: how far the gap may shrink while holding [m]; pads and parts give.
        lost: how long the force may be gone while holding [s]; a jerk of the arm unloads a finger for a moment.
        tolerance: distance from the commanded gap that counts as open [m].
        open_force: force ceiling while opening [N].
        max_gap: gap to which it opens at most [m]; the servos of a real hand need not reach that of the model.
        silent: age of the newest report from which a grip is no longer believed in [s].
    """

    contact_share: float = 0.5
    min_contact: float = 0.3
    closed_gap: float = 0.001
    rest_band: float = 0.0005
    settle: float = 0.10
    slip: float = 0.004
    lost: float = 0.05
    tolerance: float = 0.002
    open_force: float = 4.0
    max_gap: float = MAX_GAP
    silent: float = 0.20


class MagpieHand:
    """One MAGPIE hand; opens fully when it starts."""

    def __init__(self, config: MagpieConfig | None = None) -> None:
        self.config = config or MagpieConfig()
        self._last: HandState | None = None
        self.open()

    def open(self, gap: float = MAX_GAP) -> None:
        """Move the fingers to an opening of `gap` [m], clipped to what the hand can do."""
        self._begin(min(max(gap, 0.0), self.config.max_gap), self.config.open_force, GripState.OPENING)

    def close(self, force: float) -> None:
        """Close until each finger presses with `force` [N], clipped to what the servo can do."""
        self._begin(0.0, force, GripState.CLOSING)

    def step(self, state: HandState, t: float) -> HandCommand:
        """Take in what the hand reports and return what it is told at `t` [s].

        A report that is not finite, or not newer than the previous one, changes nothing. A grip of which no new report
        comes counts as slipped: nobody knows what became of it.
        """
        if _sound(state) and (self._last is None or state.t > self._last.t):
            self._observe(state)
        elif self._state is GripState.HOLDING and self._last is not None:
            if t - self._last.t > self.config.silent:
                self._state = GripState.SLIPPED
        return HandCommand(t=t, gap=self._goal, force=self._force)

    def status(self) -> HandStatus:
        """Return what the latest step found; gap, offset and force are nan before the first."""
        if self._last is None:
            return HandStatus(-math.inf, self._state, math.nan, math.nan, np.full(2, math.nan))
        offset = 0.5 * float(self._last.fingers[0] - self._last.fingers[1])
        return HandStatus(self._last.t, self._state, self._last.gap, offset, self._last.force.copy())

    def _begin(self, gap: float, force: float, state: GripState) -> None:
        self._goal = gap
        self._aim = self._force = clamp_force(force)
        self._state = state
        self._rest_gap = math.inf
        self._rest_since = math.inf
        self._pressed_at = -math.inf
        self._grip_gap = 0.0

    def _observe(self, state: HandState) -> None:
        self._last = state
        if abs(state.gap - self._rest_gap) > self.config.rest_band:
            self._rest_gap, self._rest_since = state.gap, state.t
        at_rest = state.t - self._rest_since >= self.config.settle
        if self._state is GripState.OPENING:
            if abs(state.gap - self._goal) < self.config.tolerance:
                self._state = GripState.OPEN
        elif self._state in (GripState.CLOSING, GripState.CONTACT):
            self._state = self._grasped(state, at_rest)
            self._grip_gap = state.gap
        elif self._state is GripState.HOLDING:
            gone = self._lost(state, self._min_force())
            if gone or state.gap < max(self.config.closed_gap, self._grip_gap - self.config.slip):
                self._state = GripState.SLIPPED

    def _grasped(self, state: HandState, at_rest: bool) -> GripState:
        if state.gap < self.config.closed_gap:
            return GripState.EMPTY if at_rest else self._state
        if self._lost(state, max(self._min_force(), self._share(at_rest) * self._aim)):
            return GripState.CLOSING
        return GripState.HOLDING if at_rest else GripState.CONTACT

    def _share(self, at_rest: bool) -> float:
        """Return the share of the force that makes a contact; fingers that stalled on something need not reach it."""
        return 0.0 if at_rest else self.config.contact_share

    def _min_force(self) -> float:
        return min(self.config.min_contact, 0.9 * self._aim)

    def _lost(self, state: HandState, threshold: float) -> bool:
        if float(state.force.min()) >= threshold:
            self._pressed_at = state.t
        return state.t - self._pressed_at > self.config.lost


def _sound(state: HandState) -> bool:
    return state.force.shape == (2,) and math.isfinite(sum(state.force.tolist(), state.t + state.gap))
