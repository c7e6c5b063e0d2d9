"""The nodes that protect: the emergency stop's frames, and the gate that judges every command."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from golem.hardware.estop.base import EmergencyStop
from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.gate_stage import GateStage
from golem.hardware.safety.standing_gate import StandingController, StandingGate
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.middleware.bus import Bus, News
from golem.runtime.chain import HasLink, Link
from golem.runtime.executor import Node
from golem.types import TICK

ASKED = frozenset({Reason.REQUESTED, Reason.ESTOP_PRESSED})
"""Stops that somebody asked for."""


@dataclass
class GateTally:
    """What gates have done: `active` robot time [s], and `stops` by reason, without those that were asked for."""

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


class EstopNode(Node):
    """Publishes the frames of the emergency stop."""

    def __init__(self, bus: Bus, estop: EmergencyStop) -> None:
        """Publish what `estop` says, at its own rate if it has one."""
        self._bus, self._estop = bus, estop
        self.period = estop.period if isinstance(estop, VirtualEstop) else TICK

    def step(self, t: float) -> None:
        frame = self._estop.step(t)
        if frame is not None:
            self._bus.publish(topics.ESTOP, frame, t)


class SafetyNode(HasLink):
    """Runs the safety gate; the only writer of the motors' command.

    Of what the operator asks for by `request`, `ACTIVATE` is taken up as soon as the gate is armed.
    """

    period = TICK

    def __init__(
        self, bus: Bus, limits: SafetyLimits, standing: Callable[[], StandingController] | None = None
    ) -> None:
        """Enforce `limits`; what `standing` makes gets the legs where a stop leaves them sound."""
        self._bus, self._gate = bus, StandingGate(Gate(limits), standing)
        self._faults = News(bus, topics.TRANSPORT_FAULT)
        self._tally = current_tally()
        self._chained: GateStage | None = None
        self._away = False
        self.request = OperatorRequest.NONE

    def link(self) -> Link:
        self._chained = chained = GateStage(self._gate.gate.limits)
        reads = topics.LOW_STATE, topics.LOW_CMD_REQUEST, topics.ESTOP, topics.BASE
        return Link(self, chained.stage, reads, (topics.LOW_CMD, topics.SAFETY), self._prepare, self._passed)

    def _prepare(self, t: float) -> bool:
        """Hand the gate's memory to the stage, unless the gate itself has something to decide at `t` [s]."""
        memory, stage = self._gate.memory, self._chained
        if self.request is not memory.request or self.request is OperatorRequest.STOP or self._faults.waiting:
            return False
        if not self._away:
            self._away = stage is not None and stage.take(memory)
        return self._away

    def _passed(self, ticks: int) -> None:
        if self._tally is not None:
            for _ in range(ticks):
                self._tally.add(GateState.ACTIVE, GateState.ACTIVE, None)

    def step(self, t: float) -> None:
        if self._away and self._chained is not None:
            self._away = False
            self._gate.gate.memory = self._chained.give_back(self._gate.memory)
        estop = self._bus.latest(topics.ESTOP)
        # The gate acts on the edge of a request, and an activation before it is armed would be spent for nothing.
        waiting = self.request is OperatorRequest.ACTIVATE and self._gate.memory.mode is GateState.INIT
        if waiting and estop is not None and estop.pressed:
            # Released later, the button must not set free what was asked for before it was pressed.
            self.request = OperatorRequest.NONE
        fault = self._faults.read()
        state, command = self._bus.latest(topics.LOW_STATE), self._bus.latest(topics.LOW_CMD_REQUEST)
        request, base = OperatorRequest.NONE if waiting else self.request, self._bus.latest(topics.BASE)
        inputs = GateInputs(t, state, command, estop, request, base, () if fault is None else (fault,))
        before = self._gate.memory.mode
        result = self._gate.step(inputs)
        if self._tally is not None:
            self._tally.add(before, result.state, result.reason)
        self._bus.publish(topics.LOW_CMD, result.command, t)
        self._bus.publish(topics.SAFETY, GateStatus(t, result.state, result.reason, result.detail), t)
