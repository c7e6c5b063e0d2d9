"""What a pick found out: of each object it tried, and of the work place, in words that a judge can compare."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from golem.capabilities.planning.base import PlanRefused, Refusal
from golem.skills.base import StageFailed
from golem.types import Side

RISEN = 0.003
"""How much higher a screw stands after a pull that did not take it, if it is loose and jammed [m] [own: three
standard deviations of the height that the palm camera measures]."""


class PickOutcome(StrEnum):
    """How a pick, or one of its attempts, ended."""

    PICKED = "picked"
    """It is in the container."""
    OUT_OF_REACH = "out_of_reach"
    """No hand gets there, or not along the line that the object has to be pulled along."""
    BLOCKED = "blocked"
    """Something is in the way."""
    NOTHING_THERE = "nothing_there"
    """No such object was seen, or the fingers closed on nothing."""
    TRAY_MISSING = "tray_missing"
    """The container was not seen."""
    TRAY_FULL = "tray_full"
    """What lies in the container reaches up to its rim."""
    TRAY_OUT_OF_REACH = "tray_out_of_reach"
    """No hand gets to any place in the container, or none that gets to such an object, too."""
    TIGHT = "tight"
    """It did not move."""
    JAMMED = "jammed"
    """It moved, and did not come out."""
    SLIPPED = "slipped"
    """It slipped out of the fingers, and nobody looked whether it had moved; or it was lost on the way."""
    FAILED = "failed"
    """Anything else."""


class Sight(StrEnum):
    """What a look said."""

    YES = "yes"
    NO = "no"
    UNKNOWN = "unknown"
    """Nobody looked, or the place was not in view."""


@dataclass
class Tried:
    """One object that was tried.

    Attributes:
        side: hand that tried it.
        x, y, z: where it was last seen, in odom [m].
        outcome: one of `PickOutcome`.
    """

    side: Side
    x: float
    y: float
    z: float
    outcome: str = PickOutcome.FAILED.value


@dataclass
class PickReport:
    """What a pick found out.

    Attributes:
        outcome: one of `PickOutcome`, of the whole.
        tried: every object that was approached, in order.
        in_tray: whether the head camera saw it in the container afterwards, one of `Sight`.
        bore_empty: whether it saw that the object's place is empty, one of `Sight`.
    """

    outcome: str = PickOutcome.FAILED.value
    tried: list[Tried] = field(default_factory=list[Tried])
    in_tray: str = Sight.UNKNOWN.value
    bore_empty: str = Sight.UNKNOWN.value


class PickFailed(StageFailed):
    """A stage of a pick failed, and what that says of the object or the work place is known.

    Attributes:
        outcome: what it says.
    """

    def __init__(self, outcome: PickOutcome, stage: str, slot: str, reason: str) -> None:
        """Say what it says, which `stage` failed, whose module is responsible, and why."""
        super().__init__(stage, slot, reason)
        self.outcome = outcome


_REFUSED = {
    Refusal.UNREACHABLE: PickOutcome.OUT_OF_REACH,
    Refusal.OFF_LINE: PickOutcome.OUT_OF_REACH,
    Refusal.GOAL: PickOutcome.BLOCKED,
    Refusal.START: PickOutcome.BLOCKED,
    Refusal.NO_PATH: PickOutcome.BLOCKED,
}


def outcome_of(failure: StageFailed) -> PickOutcome:
    """Return what a failure says."""
    if isinstance(failure, PickFailed):
        return failure.outcome
    if isinstance(failure.__cause__, PlanRefused):
        return _REFUSED.get(failure.__cause__.refusal, PickOutcome.FAILED)
    return PickOutcome.FAILED


def slipped(heights: list[float]) -> PickOutcome:
    """Return what a screw that slipped is, by the heights [m] at which it was seen before each pull."""
    if len(heights) < 2:
        return PickOutcome.SLIPPED
    return PickOutcome.JAMMED if max(heights[1:]) - heights[0] > RISEN else PickOutcome.TIGHT
