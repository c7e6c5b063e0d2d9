"""What the safety gate remembers from one tick to the next, and what it decides."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.hardware.safety.base import Counters, OperatorRequest, Outgoing
from golem.hardware.safety.sender import SenderMemory
from golem.hardware.safety.senses import SensesMemory
from golem.interfaces.payloads import EstopMessage, GateState, Reason
from golem.types import LowCommand, LowState


@dataclass(frozen=True, slots=True)
class GateMemory:
    """All that the gate remembers from one tick to the next; the default is a gate that has seen nothing.

    Attributes:
        t: time of the previous tick [s].
        mode: state of the gate.
        since: when it entered that state [s].
        reason, detail: why, for a state that has a reason.
        state, command, estop: newest frame accepted of each.
        counters: consecutive bad samples.
        outgoing: last command, while active.
        request: request of the previous tick.
        grounded: stamp of the newest base estimate that was not stale [s]; None before the first one since the
            activation. A robot that hangs in a band with its feet in the air has none, and is not stopped for it.
        senses: what is known of the life and the plausibility of the sensors.
        sender: what is known of whoever sends the commands.
        prompt: when the newest command was no older than `command_late` last, while active [s].
        sent: what the motors were told last.
        stopped: when the last stop began, or became stricter [s].
    """

    t: float = -np.inf
    mode: GateState = GateState.INIT
    since: float = -np.inf
    reason: Reason | None = None
    detail: str = ""
    state: LowState | None = None
    command: LowCommand | None = None
    estop: EstopMessage | None = None
    counters: Counters = field(default_factory=Counters)
    outgoing: Outgoing | None = None
    request: OperatorRequest = OperatorRequest.NONE
    grounded: float | None = None
    senses: SensesMemory = field(default_factory=SensesMemory)
    sender: SenderMemory = field(default_factory=SenderMemory)
    prompt: float = -np.inf
    sent: LowCommand | None = None
    stopped: float = -np.inf


@dataclass(frozen=True, slots=True)
class GateResult:
    """What the gate decided at one tick.

    Attributes:
        command: what the motors are to be told.
        state: state of the gate.
        reason: why it is not armed, not activated or stopped; None when all is well.
        detail: one line that names the joint and the figures behind `reason`; may be empty.
        memory: to be passed to the next tick.
    """

    command: LowCommand
    state: GateState
    reason: Reason | None
    detail: str
    memory: GateMemory
