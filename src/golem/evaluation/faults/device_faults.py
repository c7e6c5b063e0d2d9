"""Faults of devices and of processes: motors, the emergency stop, other writers, the gate's own clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from golem.evaluation.faults.command_faults import JOINTS, LIMITS
from golem.evaluation.faults.injection import Expect, FaultMoment, FaultSource, Injection
from golem.interfaces.payloads import Reason
from golem.middleware.wire.convert import encode_low_command
from golem.robots.model.table import JOINT_INDEX
from golem.types import NUM_JOINTS, LowCommand


def device_faults() -> Iterator[Injection]:
    """Yield every fault of devices and processes."""
    yield from _motors()
    yield from _estop()
    yield from _writers()
    yield from _gate()


def _stop(name: str, reasons: tuple[Reason, ...], within: float = 0.006, **more: Any) -> Injection:
    return Injection(name, FaultSource.DEVICE, Expect.STOP, reasons, within, **more)


def _motors() -> Iterator[Injection]:
    for joint in JOINTS:
        i = JOINT_INDEX[joint]

        def dead(m: FaultMoment, command: LowCommand, i: int = i) -> LowCommand:
            arrays = {name: getattr(command, name).copy() for name in ("tau", "kp", "kd")}
            for array in arrays.values():
                array[i] = 0.0
            return replace(command, **arrays)

        yield Injection(
            f"{joint} without torque",
            FaultSource.DEVICE,
            Expect.SAFE,
            (Reason.MOTOR_DEAD, *LIMITS),
            motors=dead,
            stands=i >= 13,
        )

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

        def second(m: FaultMoment, rig: Any, topic: str = topic) -> None:
            if "writer" not in m.kept:
                m.kept["writer"] = rig.writer(topic)

        stands = topic != "/lowstate"
        yield _stop(f"second writer of {topic}", (Reason.WRITERS,), 0.052, gate=second, stands=stands)

    def writes(topic: str) -> Callable[[FaultMoment, Any], None]:
        def write(m: FaultMoment, rig: Any) -> None:
            if "writer" not in m.kept:
                m.kept["writer"] = rig.writer(topic)
            q = np.full(NUM_JOINTS, 0.3)
            zeros, ones = np.zeros(NUM_JOINTS), np.ones(NUM_JOINTS)
            command = LowCommand(rig.t, q, zeros, zeros, 200.0 * ones, 2.0 * ones)
            m.kept["writer"].write(encode_low_command(command, 0, answers=rig.t))

        return write

    both = (Reason.WRITERS, Reason.NOT_IN_CONTROL)
    yield _stop("a second stack that commands", both, 0.052, gate=writes("/safety/lowcmd_in"), stands=True)
    # Its commands are overtaken by the gate's within the tick; that they come is said all the same.
    yield _stop("a second gate that commands", (Reason.NOT_IN_CONTROL,), 0.052, gate=writes("/lowcmd"))


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
