"""Faults of whoever sends the motors' commands, and of their way to the gate."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from golem.evaluation.faults.rig import Expect, FaultMoment, FaultSource, Frames, Injection, by_command, edited_command
from golem.evaluation.faults.spoils import frame_faults, set_to
from golem.interfaces.payloads import Reason
from golem.robots.model.table import JOINT_INDEX, load_limits
from golem.types import LEGS, NUM_JOINTS, UPPER

JOINTS = (
    "left_hip_pitch_joint",
    "left_knee_joint",
    "left_ankle_pitch_joint",
    "torso_joint",
    "right_shoulder_pitch_joint",
    "right_elbow_joint",
    "left_wrist_pitch_joint",
)
"""One of each kind."""
PARTS = {"all": slice(0, NUM_JOINTS), "legs": LEGS, "arms": UPPER, "knee": slice(3, 4), "elbow": slice(16, 17)}
_VENDOR = load_limits("urdf")
TORQUE, SPEED, UPPERMOST = _VENDOR.torque, _VENDOR.velocity, _VENDOR.upper
"""Maxima of the joints that a command may well ask for [N m, rad/s, rad]."""
DAMAGED, INVALID = (Reason.COMMAND_DAMAGED,), (Reason.COMMAND_DAMAGED, Reason.COMMAND_INVALID)
LIMITS = (Reason.POSITION, Reason.VELOCITY, Reason.TORQUE, Reason.BRAKING, Reason.TILT, Reason.BALANCE)
"""Reasons of a robot that was moved beyond what it may do."""
SENDER = (Reason.COMMAND_GAINS, Reason.COMMAND_JOLTS, Reason.COMMAND_BEYOND)


def command_faults() -> Iterator[Injection]:
    """Return every fault of commands."""
    return chain(_damaged(), _gains(), _motion(), _times())


def _set(field: str, part: slice, value: Any) -> Callable[[FaultMoment, bytes], Frames]:
    return by_command(set_to(value, "motor", field, part))


def _stop(name: str, reasons: tuple[Reason, ...], within: float = 0.006, **more: Any) -> Injection:
    return Injection(name, FaultSource.COMMAND, Expect.STOP, reasons, within, stands=True, **more)


def _bear(name: str, **more: Any) -> Injection:
    return Injection(name, FaultSource.COMMAND, Expect.BEAR, stands=True, **more)


def _safe(name: str, **more: Any) -> Injection:
    return Injection(name, FaultSource.COMMAND, Expect.SAFE, (*LIMITS, *SENDER), **more)


def _damaged() -> Iterator[Injection]:
    """Frames that are none, or that no motor can obey."""
    for joint in JOINTS:
        i = JOINT_INDEX[joint]
        for field, value in (("q", np.nan), ("tau", np.inf), ("kd", -np.inf)):
            yield _stop(f"{field} {value} {joint}", INVALID, command=_set(field, slice(i, i + 1), value))
        yield _stop(f"q 1e7 {joint}", INVALID, command=_set("q", slice(i, i + 1), 1e7))
    yield from frame_faults("command", 100, partial(_stop, reasons=DAMAGED), _bear)
    yield _stop("too long", DAMAGED, command=lambda m, p: [p + bytes(8)])
    yield _bear(
        "random bytes beside the sound ones once",
        command=lambda m, p: [p[:4] + m.rng.bytes(64), p] if m.k == 0 else [p],
    )
    for word, value in (("mode_pr", 1), ("mode_machine", 7)):
        yield _stop(f"{word} {value}", DAMAGED, command=by_command(set_to(value, word)))


def _gains() -> Iterator[Injection]:
    """Gains no motor can be held with."""
    limp = (Reason.COMMAND_GAINS,)
    for part, where in PARTS.items():

        def off(m: FaultMoment, image: Any, where: slice = where) -> None:
            image["motor"]["mode"][where] = 0
            if where.start == 0:
                image["first_mode"] = 0

        def zero(m: FaultMoment, image: Any, where: slice = where) -> None:
            for field in ("kp", "kd", "tau"):
                image["motor"][field][where] = 0.0

        yield _stop(f"mode 0 of {part}", limp, command=by_command(off))
        yield _stop(f"zero gains of {part}", limp, command=by_command(zero))
        yield _stop(f"kp -100 of {part}", limp, command=_set("kp", where, -100.0))
        yield _stop(f"kd -20 of {part}", limp, command=_set("kd", where, -20.0))
        yield _stop(f"kd 0 of {part}", limp, command=_set("kd", where, 0.0))
        yield _safe(f"kp 1e5 of {part}", command=_set("kp", where, 1e5))
        yield _safe(f"kd 1e5 of {part}", command=_set("kd", where, 1e5))
    yield _bear("one command without gains", command=lambda m, p: [edited_command(p, _limp) if m.k == 0 else p])


def _limp(image: Any) -> None:
    for field in ("kp", "kd", "tau"):
        image["motor"][field] = 0.0


def _motion() -> Iterator[Injection]:
    """Commands that any motor obeys, and that nobody should give."""
    for part, where in PARTS.items():
        yield _safe(f"tau 1000 of {part}", command=_set("tau", where, 1e3))
        shaken = _set("tau", where, lambda m: 1e3 * (-1) ** m.k)
        yield _stop(f"tau +-1000 each tick of {part}", (*SENDER, *LIMITS), 0.02, command=shaken)
        yield _safe(f"tau +-1000 at 10 Hz of {part}", command=_set("tau", where, lambda m: 1e3 * (-1) ** (m.k // 25)))
        full = TORQUE[where]
        yield _safe(f"tau at its limit of {part}", command=_set("tau", where, full))
        yield _safe(
            f"tau at its limits at 10 Hz of {part}",
            command=_set("tau", where, lambda m, tau=full: tau * (-1) ** (m.k // 25)),
        )
        yield _safe(f"q 1 rad beyond its range of {part}", command=_set("q", where, UPPERMOST[where] + 1.0))
        yield _safe(f"dq at its limit of {part}", command=_set("dq", where, SPEED[where]))
        yield _safe(f"q 10 rad of {part}", command=_set("q", where, 10.0))
        yield _safe(f"q -10 rad of {part}", command=_set("q", where, -10.0))
        yield _safe(f"dq 100 of {part}", command=_set("dq", where, 100.0))
        for size, period in ((0.5, 1), (0.02, 1), (0.5, 50)):

            def shake(m: FaultMoment, image: Any, where: slice = where, size: float = size, n: int = period) -> None:
                image["motor"]["q"][where] += size * (-1) ** (m.k // n)

            yield _safe(f"q +-{size} every {2 * period} ms of {part}", command=by_command(shake))


def _times() -> Iterator[Injection]:
    """Commands that come late, twice, out of order, or not at all."""
    stale = (Reason.COMMAND_STALE,)
    yield _stop("silent", stale, 0.104, command=lambda m, p: [])
    yield _stop("almost empty frames", DAMAGED, command=lambda m, p: [p[:8]])
    yield _stop("the same frame for ever", stale, 0.106, command=_first)
    yield _stop("without a stamp", (Reason.COMMAND_UNSTAMPED,), command=_answering(lambda tick: 0))
    yield _stop(
        "the same frame for ever, without a stamp",
        (Reason.COMMAND_UNSTAMPED,),
        command=lambda m, p: _answering(lambda tick: 0)(m, _first(m, p)[0]),
    )
    yield _stop("answers a state to come", stale, 0.104, command=_answering(lambda tick: tick + 500))
    yield _stop("answers a state long past", stale, 0.104, command=_answering(lambda tick: max(1, tick - 1000)))
    for late in (10, 30, 90):
        yield Injection(f"{late} ms late", FaultSource.COMMAND, Expect.SAFE, stale, command=_late(late // 2))
    yield _stop("150 ms late", stale, 0.106, command=_late(75))
    yield _stop("all but 1 of 70 lost", stale, 0.15, command=lambda m, p: [p] if m.k % 70 == 69 else [])
    yield _bear("every frame twenty times", command=lambda m, p: [p] * 20)
    yield _bear("in pairs the wrong way round", command=_reordered)


def _first(m: FaultMoment, payload: bytes) -> Frames:
    return [m.kept.setdefault("first", payload)]


def _answering(stamp: Callable[[int], int]) -> Callable[[FaultMoment, bytes], Frames]:
    def spoil(m: FaultMoment, payload: bytes) -> Frames:
        def edit(image: Any) -> None:
            image["reserve"][0] = stamp(int(image["reserve"][0]))

        return [edited_command(payload, edit)]

    return spoil


def _late(ticks: int) -> Callable[[FaultMoment, bytes], Frames]:
    def spoil(m: FaultMoment, payload: bytes) -> Frames:
        queue = m.kept.setdefault("queue", [])
        queue.append(payload)
        return [queue.pop(0)] if len(queue) > ticks else []

    return spoil


def _reordered(m: FaultMoment, payload: bytes) -> Frames:
    held = m.kept.pop("held", None)
    if held is None:
        m.kept["held"] = payload
        return []
    return [payload, held]
