"""The contract of an emergency stop: frames that keep coming, each saying whether the button is pressed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable


@dataclass(frozen=True, slots=True)
class EstopMessage:
    """One frame of an emergency-stop board.

    Attributes:
        t: time of reception [s].
        sequence: counts up by one per frame and may wrap; a frame with the sequence of its predecessor says nothing.
        pressed: whether the button is pressed, or its wire cut.
    """

    t: float
    sequence: int
    pressed: bool


@runtime_checkable
class EmergencyStop(Protocol):
    """A source of emergency-stop frames. Its silence stops the robot just as its button does."""

    def step(self, t: float) -> EstopMessage | None:
        """Return the frame that arrived at `t` [s], or None when none did."""
        ...
