"""A behaviour tree as small as they come: what is done about a way that is blocked, in which order.

A behaviour is ticked until it ends. A `Sequence` goes on to its next child when one succeeds, a `Fallback` when one
fails; both begin again once they have ended (Colledanchise and Oegren, Behavior Trees in Robotics and AI, 2018).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Protocol


class BehaviourStatus(Enum):
    """How a behaviour stands."""

    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"


class Behaviour(Protocol):
    """One node of a tree."""

    def tick(self, dt: float) -> BehaviourStatus:
        """Go on for `dt` [s]."""
        ...

    def reset(self) -> None:
        """Begin again at the next tick."""


class Action(Behaviour):
    """A leaf that runs a function of the time since it began [s]."""

    def __init__(self, function: Callable[[float], BehaviourStatus]) -> None:
        self._function, self._t = function, 0.0

    def tick(self, dt: float) -> BehaviourStatus:
        status = self._function(self._t)
        self._t = self._t + dt if status is BehaviourStatus.RUNNING else 0.0
        return status

    def reset(self) -> None:
        self._t = 0.0


class Composite(Behaviour):
    """Ticks one child after the other, as long as each ends with `goes_on`."""

    goes_on: BehaviourStatus

    def __init__(self, *children: Behaviour) -> None:
        self._children, self._at = children, 0

    def tick(self, dt: float) -> BehaviourStatus:
        status = self._children[self._at].tick(dt)
        if status is self.goes_on and self._at + 1 < len(self._children):
            self._at += 1
            return BehaviourStatus.RUNNING
        if status is not BehaviourStatus.RUNNING:
            self.reset()
        return status

    def reset(self) -> None:
        self._at = 0
        for child in self._children:
            child.reset()


class InSequence(Composite):
    """Succeeds when all of its children did, fails with the first that does."""

    goes_on = BehaviourStatus.SUCCESS


class Fallback(Composite):
    """Succeeds with the first of its children that does, fails when all did."""

    goes_on = BehaviourStatus.FAILURE
