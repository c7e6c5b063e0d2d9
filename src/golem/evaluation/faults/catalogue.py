"""Every fault that is tried, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from golem.evaluation.faults.class_faults import KNEE, LYING, class_faults, scaled
from golem.evaluation.faults.command_faults import JOINTS, LIMITS, command_faults
from golem.evaluation.faults.data_faults import data_faults
from golem.evaluation.faults.rig import Expect, FaultMoment, FaultSource, Frames, Injection, by_command, by_state
from golem.evaluation.faults.spoils import by_imu, second_writer, set_to, shifted, turned, weak
from golem.interfaces.payloads import Reason
from golem.robots.model.table import JOINT_INDEX
from golem.types import NUM_JOINTS


def _knee(field: str, value: int) -> dict[str, Any]:
    return {"state": by_state(set_to(value, "motor", field, KNEE))}


HARD: dict[str, tuple[tuple[Reason, ...], dict[str, Any]]] = {
    "a knee reports an error": ((Reason.MOTOR,), _knee("motorstate", 1)),
    "a knee at 180 degrees": ((Reason.MOTOR_HOT,), _knee("temperature", 180)),
    "a knee says it is off": ((Reason.MOTOR_MODE,), _knee("mode", 0)),
    "no state": ((Reason.STATE_STALE,), {"state": lambda m, p: []}),
    "truncated states": ((Reason.STATE_DAMAGED,), {"state": lambda m, p: [p[:-8]]}),
    "IMU upside down": (
        (Reason.IMU_IMPLAUSIBLE, Reason.TILT),
        {"senses": by_imu(lambda m, u: replace(u, quat=turned(0, np.pi, u.quat)))},
    ),
}
"""Faults after which nobody stands, and their reasons."""


SOFT: dict[str, dict[str, Any]] = {
    "second writer": {"gate": second_writer("/safety/lowcmd_in")},
    "no stamp": {"command": by_command(set_to(0, "reserve", 0))},
    "no command": {"command": lambda m, p: []},
    "damaged commands": {"command": lambda m, p: [p[:-8]]},
}
"""Faults that leave legs and state sound."""


def _two_at_once() -> Iterator[Injection]:
    for hard, (reasons, one) in HARD.items():
        for soft, other in SOFT.items():
            yield Injection(f"{hard} and {soft}", FaultSource.DEVICE, Expect.STOP1, reasons, 0.25, **one, **other)


def _while_stopped() -> Iterator[Injection]:
    """The stack is silent from the begin on; a second later something else goes wrong."""

    def later(spoil: Callable[..., Any], sound: Callable[..., Any]) -> Callable[..., Any]:
        return lambda m, *what: (spoil if m.t > 1.0 else sound)(m, *what)

    for hard, (reasons, one) in HARD.items():
        sound: dict[str, Any] = {"state": lambda m, p: [p], "senses": lambda m, s: s}
        late: dict[str, Any] = {key: later(spoil, sound[key]) for key, spoil in one.items()}
        yield Injection(
            f"{hard} while stopped", FaultSource.DEVICE, Expect.STOP1, reasons, 1.25, command=lambda m, p: [], **late
        )

    silent: dict[str, Any] = {"command": lambda m, p: [], "lasting": 3.0}
    stale = (Reason.COMMAND_STALE,)
    dead = weak(KNEE, lambda m: 0.0 if m.t > 1.0 else 1.0)
    yield _safe("a knee without torque while stopped", (*stale, *LYING), motors=dead, **silent)
    spike = shifted(KNEE, lambda m: 0.5 * (m.k % 60 == 0 and m.t > 1.0))
    yield _safe("a knee jumps in 1 of 60 states while stopped", stale, stands=True, senses=spike, **silent)

    def again(m: FaultMoment, rig: Any) -> None:
        if m.k % 10 == 0:
            rig.reset()
        if m.k % 10 == 5:
            rig.activate()

    def limp(m: FaultMoment, payload: bytes) -> Frames:
        edit = scaled(("kp", "kd", "tau"), slice(0, NUM_JOINTS), lambda m: 0.0, None)
        return [] if m.t < 0.25 else by_command(edit)(m, payload)

    yield Injection(
        "reset and activation for limp commands",
        FaultSource.COMMAND,
        Expect.SAFE,
        stale,
        stands=True,
        lasting=3.0,
        command=limp,
        gate=again,
    )
    yield Injection(
        "reset and activation at 50 Hz while it falls",
        FaultSource.DEVICE,
        Expect.STOP1,
        (Reason.MOTOR,),
        0.25,
        lasting=1.2,
        state=by_state(lambda m, image: set_to(1, "motor", "motorstate", KNEE)(m, image) if m.t < 0.1 else None),
        gate=again,
    )


def _stop(name: str, reasons: tuple[Reason, ...], within: float = 0.006, **more: Any) -> Injection:
    return Injection(name, FaultSource.DEVICE, Expect.STOP, reasons, within, **more)


def _safe(name: str, reasons: tuple[Reason, ...], **more: Any) -> Injection:
    return Injection(name, FaultSource.DEVICE, Expect.SAFE, reasons, **more)


def _motors() -> Iterator[Injection]:
    for joint in JOINTS:
        i = JOINT_INDEX[joint]
        dead = weak(i, lambda m: 0.0)
        yield _safe(f"{joint} without torque", (Reason.MOTOR_DEAD, *LIMITS), motors=dead, stands=i >= 13)

    def changed(m: FaultMoment, rig: Any) -> None:
        rig.machine = 7

    yield _stop("mode_machine changes", (Reason.MOTOR_MODE,), 0.004, gate=changed)


def _estop() -> Iterator[Injection]:
    def press(m: FaultMoment, rig: Any) -> None:
        rig.estop.pressed = True

    def silent(m: FaultMoment, rig: Any) -> None:
        rig.estop.period = 1e9
        rig.estop._due = 1e12

    def repeats(m: FaultMoment, rig: Any) -> None:
        rig.estop._sequence = m.kept.setdefault("sequence", rig.estop._sequence)

    yield _stop("e-stop pressed", (Reason.ESTOP_PRESSED,), 0.012, gate=press)
    yield _stop("e-stop silent", (Reason.ESTOP_STALE,), 0.062, gate=silent)
    yield _stop("e-stop repeats its sequence", (Reason.ESTOP_STALE,), 0.062, gate=repeats)


def _writers() -> Iterator[Injection]:
    for topic in ("/safety/lowcmd_in", "/lowcmd", "/lowstate"):
        stands = topic != "/lowstate"
        yield _stop(f"second writer of {topic}", (Reason.WRITERS,), 0.052, gate=second_writer(topic), stands=stands)
    both = (Reason.WRITERS, Reason.NOT_IN_CONTROL)
    yield _stop("a second stack that commands", both, 0.052, gate=second_writer("/safety/lowcmd_in", True), stands=True)
    # Its commands are overtaken by the gate's within the tick; that they come is said all the same.
    yield _stop("a second gate that commands", (Reason.NOT_IN_CONTROL,), 0.052, gate=second_writer("/lowcmd", True))


def _gate() -> Iterator[Injection]:
    def held(seconds: float) -> Callable[[FaultMoment, Any], None]:
        def hold(m: FaultMoment, rig: Any) -> None:
            rig.held = m.t < seconds

        return hold

    def shifted(seconds: float) -> Callable[[FaultMoment, Any], None]:
        def shift(m: FaultMoment, rig: Any) -> None:
            rig.clock = seconds

        return shift

    for seconds in (0.02, 0.06):
        yield Injection(
            f"gate held up for {1e3 * seconds:g} ms", FaultSource.DEVICE, Expect.BEAR, gate=held(seconds), stands=True
        )
    for seconds in (0.3, 1.0):
        yield _stop(f"gate held up for {1e3 * seconds:g} ms", (Reason.STALLED,), seconds + 0.004, gate=held(seconds))
    for seconds in (-1.0, -0.01):
        yield _stop(f"gate's clock {seconds:+g} s", (Reason.CLOCK,), gate=shifted(seconds))
    for seconds in (0.2, 10.0):
        yield _stop(f"gate's clock {seconds:+g} s", (Reason.STALLED,), gate=shifted(seconds))


_DEVICES = (_motors(), _estop(), _writers(), _gate())
_ALL = chain(command_faults(), data_faults(), *_DEVICES, class_faults(), _two_at_once(), _while_stopped())
FAULTS: dict[str, Injection] = {fault.name: fault for fault in _ALL}
