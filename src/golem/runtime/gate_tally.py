"""How long safety gates let commands through, and how often they stopped, in the stacks that run meanwhile."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from golem.interfaces.payloads import GateState, Reason
from golem.types import TICK

ASKED = frozenset({Reason.REQUESTED, Reason.ESTOP_PRESSED})
"""Stops that somebody asked for."""


@dataclass
class GateTally:
    """What gates have done.

    Attributes:
        active: robot time in which commands passed [s].
        stops: stops by reason, without those that were asked for.
    """

    active: float = 0.0
    stops: Counter[str] = field(default_factory=Counter[str])

    def add(self, before: GateState, after: GateState, reason: Reason | None) -> None:
        """Count one tick of a gate that went from one state to another."""
        if after is GateState.ACTIVE:
            self.active += TICK
        elif before is GateState.ACTIVE and reason is not None and reason not in ASKED:
            self.stops[str(reason)] += 1


_CURRENT: ContextVar[GateTally | None] = ContextVar("gate_tally", default=None)


def current_tally() -> GateTally | None:
    """Return where gates that are made now count; None where nobody asked."""
    return _CURRENT.get()


@contextmanager
def tallied() -> Generator[GateTally]:
    """Count what the gates do that are made meanwhile; those of forked copies count for themselves."""
    tally = GateTally()
    token = _CURRENT.set(tally)
    try:
        yield tally
    finally:
        _CURRENT.reset(token)
