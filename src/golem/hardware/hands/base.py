"""The contract of a hand's controller: open to a gap or close with a force, and know what is between the fingers."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol, runtime_checkable

from golem.types import Array, HandCommand, HandState


class GripState(StrEnum):
    """What a hand is doing, or has found."""

    OPENING = "opening"
    """The fingers move to a commanded gap."""
    OPEN = "open"
    """They are there."""
    CLOSING = "closing"
    """They close; nothing is touched by both."""
    CONTACT = "contact"
    """Both fingers touch something; the grip has not settled yet."""
    HOLDING = "holding"
    """Both fingers press on something and the gap is at rest."""
    EMPTY = "empty"
    """They closed on nothing."""
    SLIPPED = "slipped"
    """Something was held and no longer is."""


@dataclass(frozen=True, slots=True)
class HandStatus:
    """What a hand's controller reports.

    Attributes:
        t: time stamp of the report it is based on [s].
        state: see `GripState`.
        gap: opening [m].
        offset: where between the fingers the middle of the opening is, along the closing axis [m]: 0 when both are
            equally far from the hand's centre plane, positive when finger a (+y) is further out.
        force: (2,) force of each finger [N].
    """

    t: float
    state: GripState
    gap: float
    offset: float
    force: Array

    @property
    def holding(self) -> bool:
        """Whether something is held: both fingers press, wider apart than closed, at rest."""
        return self.state is GripState.HOLDING


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
