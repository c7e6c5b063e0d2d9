"""Two faults at once, and faults that come while the robot is stopped already."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from golem.evaluation.faults.class_faults import KNEE, LYING, by_imu, scaled, turned
from golem.evaluation.faults.injection import Expect, FaultMoment, FaultSource, Frames, Injection, by_command, by_state
from golem.interfaces.payloads import Reason
from golem.types import NUM_JOINTS, LowCommand, LowState


def combined_faults() -> Iterator[Injection]:
    """Yield every one of them."""
    yield from _two_at_once()
    yield from _while_stopped()


def _error(m: FaultMoment, image: Any) -> None:
    image["motor"]["motorstate"][KNEE] = 1


def _hot(m: FaultMoment, image: Any) -> None:
    image["motor"]["temperature"][KNEE] = 180


def _off(m: FaultMoment, image: Any) -> None:
    image["motor"]["mode"][KNEE] = 0


HARD: dict[str, tuple[tuple[Reason, ...], dict[str, Any]]] = {
    "a knee reports an error": ((Reason.MOTOR,), {"state": by_state(_error)}),
    "a knee at 180 degrees": ((Reason.MOTOR_HOT,), {"state": by_state(_hot)}),
    "a knee says it is off": ((Reason.MOTOR_MODE,), {"state": by_state(_off)}),
    "no state": ((Reason.STATE_STALE,), {"state": lambda m, p: []}),
    "truncated states": ((Reason.STATE_DAMAGED,), {"state": lambda m, p: [p[:-8]]}),
    "IMU upside down": (
        (Reason.IMU_IMPLAUSIBLE, Reason.TILT),
        {"senses": by_imu(lambda m, u: replace(u, quat=turned(0, np.pi, u.quat)))},
    ),
}
"""Faults after which nobody stands, and their reasons."""


def _unstamped(m: FaultMoment, image: Any) -> None:
    image["reserve"][0] = 0


def _second(m: FaultMoment, rig: Any) -> None:
    if "writer" not in m.kept:
        m.kept["writer"] = rig.writer("/safety/lowcmd_in")


SOFT: dict[str, dict[str, Any]] = {
    "second writer": {"gate": _second},
    "no stamp": {"command": by_command(_unstamped)},
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

    def dead(m: FaultMoment, c: LowCommand) -> LowCommand:
        gain = np.where((np.arange(NUM_JOINTS) == KNEE) & (m.t > 1.0), 0.0, 1.0)
        return replace(c, kp=c.kp * gain, kd=c.kd * gain, tau=c.tau * gain)

    def spike(m: FaultMoment, s: LowState) -> LowState:
        q = s.q.copy()
        q[KNEE] += 0.5 * (m.k % 60 == 0 and m.t > 1.0)
        return replace(s, q=q)

    silent: dict[str, Any] = {"command": lambda m, p: [], "lasting": 3.0}
    stale = (Reason.COMMAND_STALE,)
    yield Injection(
        "a knee without torque while stopped", FaultSource.DEVICE, Expect.SAFE, (*stale, *LYING), motors=dead, **silent
    )
    yield Injection(
        "a knee jumps in 1 of 60 states while stopped",
        FaultSource.DEVICE,
        Expect.SAFE,
        stale,
        stands=True,
        senses=spike,
        **silent,
    )

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
        state=by_state(lambda m, image: _error(m, image) if m.t < 0.1 else None),
        gate=again,
    )
