"""What a fault is: which of the ways into the safety layer it spoils, and what is expected of the gate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np

from golem.interfaces.payloads import Reason
from golem.middleware.wire import hg
from golem.types import LowCommand, LowState


class Expect(StrEnum):
    """What a gate has to do under a fault."""

    STOP = "stop"
    """Stop for one of the reasons, in time."""
    STOP1 = "stop1"
    """The same, and damp: nobody stands with it."""
    BEAR = "bear"
    """Go on, and the robot with it as if there were no fault."""
    SAFE = "safe"
    """Stop or go on: what the robot does is judged, and no limit may be left."""


class FaultSource(StrEnum):
    """Where a fault comes from."""

    COMMAND = "command"
    DATA = "data"
    DEVICE = "device"
    """A motor, the emergency stop, the gate's own process."""


@dataclass
class FaultMoment:
    """How far a fault has come.

    Attributes:
        t: time since it began [s].
        k: ticks since then.
        kept: what the fault remembers from one tick to the next.
        rng: its own noise.
    """

    t: float = 0.0
    k: int = 0
    kept: dict[str, Any] = field(default_factory=dict[str, Any])
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))


Edit = Callable[[FaultMoment, Any], None]
"""Changes the image of a frame."""
Frames = Sequence[bytes]


@dataclass(frozen=True)
class Injection:
    """One fault.

    Attributes:
        name: what people call it.
        source: where it comes from.
        expect: what the gate has to do.
        reasons: the right ones for a stop.
        within: robot time in which the gate has to stop [s].
        lasting: how long it is watched [s].
        stands: whether it leaves legs and state sound, so that a robot that stood has to stand in the end.
        state, command: spoil a frame on its way to the gate, into any number of frames.
        senses: spoils what the robot measures, for the gate and the stack alike.
        motors: spoils what the motors make of a command.
        gate: called with the rig before each tick of the gate.
    """

    name: str
    source: FaultSource
    expect: Expect
    reasons: tuple[Reason, ...] = ()
    within: float = 0.002
    lasting: float = 1.5
    stands: bool = False
    state: Callable[[FaultMoment, bytes], Frames] | None = None
    command: Callable[[FaultMoment, bytes], Frames] | None = None
    senses: Callable[[FaultMoment, LowState], LowState] | None = None
    motors: Callable[[FaultMoment, LowCommand], LowCommand] | None = None
    gate: Callable[[FaultMoment, Any], None] | None = None


def edited_state(payload: bytes, edit: Callable[[Any], None]) -> bytes:
    """Return the `LowState_` with its image edited, and a checksum that holds."""
    changed = bytearray(payload)
    edit(hg.LOW_STATE.read(changed))
    hg.STATE_CHECKSUM.seal(changed)
    return bytes(changed)


def edited_command(payload: bytes, edit: Callable[[Any], None]) -> bytes:
    """Return the `LowCmd_` with its image edited, and a checksum that holds."""
    changed = bytearray(payload)
    edit(hg.LOW_CMD.read(changed))
    hg.COMMAND_CHECKSUM.seal(changed)
    return bytes(changed)


def by_command(edit: Edit) -> Callable[[FaultMoment, bytes], Frames]:
    """Return a fault that edits each command."""
    return lambda m, payload: [edited_command(payload, lambda image: edit(m, image))]


def by_state(edit: Edit) -> Callable[[FaultMoment, bytes], Frames]:
    """Return a fault that edits each state."""
    return lambda m, payload: [edited_state(payload, lambda image: edit(m, image))]
