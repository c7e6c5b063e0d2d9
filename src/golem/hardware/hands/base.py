"""The contract of a hand's controller: open to a gap or close with a force, and know what is between the fingers."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from golem.interfaces.payloads import HandStatus
from golem.types import HandCommand, HandState


@runtime_checkable
class HandController(Protocol):
    """One hand, between the skill and the servos. Passive: it acts only in `step`."""

    def open(self, gap: float) -> None:
        """Move the fingers to an opening of `gap` [m]."""
        ...

    def close(self, force: float) -> None:
        """Close until each finger presses with `force` [N]."""
        ...

    def step(self, state: HandState, t: float) -> HandCommand:
        """Take in what the hand reports and return what it is told at `t` [s]."""
        ...

    def status(self) -> HandStatus:
        """Return what the latest step found; gap, offset and force are nan before the first."""
        ...
