"""The gate with a controller behind it that can stand; the controller itself is whoever's runs the gate."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Protocol

from golem.hardware.safety.base import STANDING, GateInputs
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.memory import GateMemory, GateResult
from golem.interfaces.payloads import GateState
from golem.types import Array, LowCommand, LowState


class StandingController(Protocol):
    """A controller that stands by the state alone."""

    def start(self, state: LowState) -> None:
        """Take the legs of the robot in `state`."""
        ...

    def step(self, state: LowState, damping: Array) -> LowCommand:
        """Return what the motors are told in `state`: legs that stand, and `damping` (27,) for all others.

        Whatever it raises is a stop by the name `STANDING`.
        """
        ...


class StandingGate:
    """The gate, with a controller behind it that can stand. `gate`: the gate."""

    def __init__(self, gate: Gate, make: Callable[[], StandingController] | None) -> None:
        """Give the legs to what `make` makes, at the first stop that leaves them sound; None always damps."""
        self.gate, self._make = gate, make
        self._legs: StandingController | None = None
        self._started = False

    @property
    def memory(self) -> GateMemory:
        """What the gate remembers."""
        return self.gate.memory

    def prepare(self) -> None:
        """Compile and make now what the ticks need: where the wall clock counts, none of them must wait."""
        self.gate.prepare()
        self._make_legs()

    def _make_legs(self) -> None:
        if self._make is not None and self._legs is None:
            self._legs = self._make()

    def step(self, inputs: GateInputs) -> GateResult:
        """Run the gate, and the legs if they are the controller's."""
        before = self.gate.memory
        standing = None
        if before.mode is GateState.STOP2 and self._legs is not None and self._started and before.state is not None:
            # By the state that was believed last: the newest may be an outlier.
            with contextlib.suppress(Exception):  # what a process that guards must outlive; the gate then damps
                standing = self._legs.step(_believed(before.state), self.gate.limits.damping)
        if self._make is not None:
            # `replace` would take a fifth of the tick.
            i = inputs
            frames = i.t, i.state, i.command, i.estop, i.request, i.base, i.transport, i.tick
            inputs = GateInputs(*frames, True, standing, i.earlier)
        result = self.gate.step(inputs)
        if result.state is GateState.STOP2 and before.mode is not GateState.STOP2:
            self._make_legs()
            assert self._legs is not None and result.memory.state is not None
            self._started = False
            with contextlib.suppress(Exception):  # who did not start is not asked to step: the gate then damps
                self._legs.start(_believed(result.memory.state))
                self._started = True
        return result


def _believed(state: LowState) -> LowState:
    """Return `state` with arms that do not move: they damp, and it may be their speeds that are false."""
    dq = state.dq.copy()
    dq[STANDING.stop :] = 0.0
    return LowState(state.t, state.q, dq, state.tau, state.imu)
