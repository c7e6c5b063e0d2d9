"""Runs a leg controller at its own rate inside a faster loop."""

from __future__ import annotations

from golem.capabilities.legs.base import LocomotionCommand, LowerBody
from golem.interfaces.payloads import LegCommand
from golem.types import BaseEstimate, LowState


class RateDivider:
    """Steps a controller whenever its period has passed; in between its last command stands."""

    def __init__(self, controller: LowerBody) -> None:
        """Run `controller`, whose first tick is the first of the loop."""
        self.controller = controller
        self.runs = 0
        self._command: LegCommand | None = None
        self._elapsed = 0.0
        self._due = 0.0

    def reset(self, state: LowState) -> None:
        """Reset the controller to the measured `state`; it runs again at the next tick of the loop."""
        self.controller.reset(state)
        self._command = None

    def step(self, state: LowState, base: BaseEstimate, motion: LocomotionCommand, dt: float) -> LegCommand:
        """Return the command that stands `dt` [s] after the previous tick of the loop; see `LowerBody.step`."""
        if self._command is None:
            self._elapsed, self._due = dt, 0.0
        else:
            self._elapsed += dt
            self._due -= dt
        # A microsecond of slack: periods and ticks are binary fractions.
        if self._command is None or self._due < 1e-6:
            self._command = self.controller.step(state, base, motion, self._elapsed)
            self.runs += 1
            self._due += 1.0 / self.controller.rate
            self._elapsed = 0.0
        return self._command
