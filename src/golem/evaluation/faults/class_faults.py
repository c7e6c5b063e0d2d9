"""Faults by class: limp in all but name, senders that hang, drifts below a threshold, sensors that lie."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from typing import Any

import numpy as np

from golem.evaluation.faults.command_faults import JOINTS, LIMITS, PARTS, SENDER, TORQUE
from golem.evaluation.faults.rig import Edit, Expect, FaultMoment, FaultSource, Injection, by_command, by_state
from golem.evaluation.faults.spoils import Senses, by_imu, set_to, shifted, turned, weak
from golem.interfaces.payloads import Reason
from golem.robots.model.table import JOINT_INDEX
from golem.types import LEGS, LowState

KNEE = 3
BALANCE = (*SENDER, *LIMITS, Reason.COMMAND_HUNG)
LYING = (
    *LIMITS,
    Reason.STATE_FROZEN,
    Reason.STATE_IMPLAUSIBLE,
    Reason.IMU_IMPLAUSIBLE,
    Reason.MOTOR_DEAD,
    Reason.BALANCE,
    Reason.COMMAND_JOLTS,
)


def class_faults() -> Iterator[Injection]:
    """Return every fault of these classes."""
    return chain(_limp(), _senders(), _lies(), _reports(), _gate())


def scaled(fields: tuple[str, ...], where: slice, share: Callable[[FaultMoment], float], kd: float | None) -> Edit:
    """Return an edit that scales gains or torques."""

    def edit(m: FaultMoment, image: Any) -> None:
        motors = image["motor"]
        for name in fields:
            motors[name][where] *= share(m)
        if kd is not None:
            motors["kd"][where] = kd

    return edit


def _limp() -> Iterator[Injection]:
    soft, all_ = ("kp", "tau"), ("kp", "kd", "tau")
    kinds: dict[str, tuple[tuple[str, ...], Callable[[FaultMoment], float], float | None]] = {
        "limp, kd 1e-6": (soft, lambda m: 0.0, 1e-6),
        "limp, kd 1e-2": (soft, lambda m: 0.0, 1e-2),
        "limp with their damping": (soft, lambda m: 0.0, None),
        "gains to zero in 5 s": (all_, lambda m: max(0.0, 1.0 - m.t / 5.0), None),
        "stiffness to zero in 5 s": (soft, lambda m: max(0.0, 1.0 - m.t / 5.0), None),
        "limp in every other command": (soft, lambda m: float(m.k % 2), None),
        "limp in 3 of 4 commands, kd 1e-6": (soft, lambda m: float(m.k % 4 == 0), 1e-6),
    }
    for part, where in PARTS.items():
        for name, (fields, share, kd) in kinds.items():
            rest = {"lasting": 7.0 if "5 s" in name else 1.5, "command": by_command(scaled(fields, where, share, kd))}
            yield Injection(f"{name}: {part}", FaultSource.COMMAND, Expect.SAFE, BALANCE, stands=True, **rest)


def _senders() -> Iterator[Injection]:
    def exchanged(a: slice, b: slice) -> Edit:
        def edit(m: FaultMoment, image: Any) -> None:
            for name in ("q", "dq", "tau", "kp", "kd"):
                column = image["motor"][name]
                column[a], column[b] = column[b].copy(), column[a].copy()

        return edit

    def hung(m: FaultMoment, image: Any) -> None:
        image["motor"][:] = m.kept.setdefault("motor", image["motor"].copy())

    def legs_hung(m: FaultMoment, image: Any) -> None:
        image["motor"]["q"][LEGS] = m.kept.setdefault("q", image["motor"]["q"][LEGS].copy())

    def old(ticks: int) -> Edit:
        def edit(m: FaultMoment, image: Any) -> None:
            queue = m.kept.setdefault("queue", [])
            queue.append(image["motor"].copy())
            image["motor"][:] = queue[m.k - min(ticks, m.k // 2)]

        return edit

    def pushed(seconds: float) -> Edit:
        def edit(m: FaultMoment, image: Any) -> None:
            image["motor"]["tau"][LEGS] += min(1.0, m.t / seconds) * TORQUE[LEGS]

        return edit

    def moved(size: float, where: Any) -> Edit:
        def edit(m: FaultMoment, image: Any) -> None:
            image["motor"]["q"][where] += size * min(1.0, m.t / 3.0)

        return edit

    edits: dict[str, Edit] = {
        "the same content for ever": hung,
        "the same targets of the legs for ever": legs_hung,
        "content 50 ms old": old(25),
        "content 100 ms old": old(50),
        "content 200 ms old": old(100),
        "legs exchanged": exchanged(slice(0, 6), slice(6, 12)),
        "knees exchanged": exchanged(slice(3, 4), slice(9, 10)),
        "hips exchanged": exchanged(slice(0, 3), slice(6, 9)),
        "feed-forward of the legs to its limit in 1 s": pushed(1.0),
        "feed-forward of the legs to its limit in 5 s": pushed(5.0),
        "ankles lean by 0.3 rad in 3 s": moved(0.3, [4, 10]),
        "ankles lean by -0.3 rad in 3 s": moved(-0.3, [4, 10]),
        "knees bend by 1 rad in 3 s": moved(1.0, [3, 9]),
        "hips roll by 0.4 rad in 3 s": moved(0.4, [2, 8]),
    }
    for name, edit in edits.items():
        yield Injection(
            name, FaultSource.COMMAND, Expect.SAFE, BALANCE, lasting=6.0, stands=True, command=by_command(edit)
        )


def _lies() -> Iterator[Injection]:
    def lie(name: str, senses: Senses, seconds: float = 4.0) -> Injection:
        return Injection(f"state: {name}", FaultSource.DATA, Expect.SAFE, LYING, lasting=seconds, senses=senses)

    def alive(m: FaultMoment, s: LowState, imu: bool, joints: bool) -> LowState:
        kept, r = m.kept.setdefault("state", s), m.rng.standard_normal
        if imu:
            u = kept.imu
            new = replace(u, quat=u.quat + 1e-7 * r(4), gyro=u.gyro + 1e-6 * r(3), acc=u.acc + 1e-5 * r(3))
            s = replace(s, imu=new)
        if joints:
            q, dq, tau = kept.q + 1e-6 * r(27), 1e-5 * r(27), kept.tau + 1e-4 * r(27)
            s = replace(s, q=q, dq=dq, tau=tau)
        return s

    for name, imu, joints in (("everything", True, True), ("IMU", True, False), ("joints", False, True)):
        yield lie(f"{name} frozen, noise in the last digit", lambda m, s, i=imu, j=joints: alive(m, s, i, j))
    for axis, word in enumerate(("roll", "pitch", "yaw")):
        for rate in (0.02, 0.03, -0.05, 0.1):
            drift = by_imu(lambda m, u, a=axis, r=rate: replace(u, quat=turned(a, r * m.t, u.quat)))
            yield lie(f"{word} drifts by {rate:g} rad/s", drift, 9.0)
        for gain in (-1.0, 0.5):
            scale = np.where(np.arange(3) == axis, gain, 1.0)
            yield lie(f"gyro's {word} rate times {gain:g}", by_imu(lambda m, u, k=scale: replace(u, gyro=u.gyro * k)))

    def stuck(m: FaultMoment, s: LowState, i: int) -> LowState:
        q, dq = s.q.copy(), s.dq.copy()
        q[i], dq[i] = m.kept.setdefault("q", float(s.q[i])), 0.0
        return replace(s, q=q, dq=dq)

    for joint in JOINTS:
        i = JOINT_INDEX[joint]
        for rate in (0.03, -0.05):
            yield lie(f"{joint} drifts by {rate:g} rad/s", shifted(i, lambda m, r=rate: r * m.t), 6.0)
        yield lie(f"{joint} stuck", lambda m, s, i=i: stuck(m, s, i))


def _reports() -> Iterator[Injection]:
    times: dict[str, Callable[[int], bool]] = {
        "in 4 of 5 looks": lambda k: (k // 5) % 5 != 0,
        "in every other frame": lambda k: k % 2 == 0,
        "in 4 of 5 frames": lambda k: k % 5 != 0,
        "in 1 of 5 frames": lambda k: k % 5 == 0,
    }
    words = {
        "reports an error": ("motorstate", 1, Reason.MOTOR),
        "says it is off": ("mode", 0, Reason.MOTOR_MODE),
        "at 180 degrees": ("temperature", 180, Reason.MOTOR_HOT),
    }
    for joint in (JOINTS[1], JOINTS[5]):
        for what, (field, value, reason) in words.items():
            for when, now in times.items():
                if field == "temperature" and "frame" in when:
                    continue  # no motor cools down in 2 ms

                edit = set_to(value, "motor", field, JOINT_INDEX[joint])
                spoil = by_state(lambda m, image, edit=edit, now=now: edit(m, image) if now(m.k) else None)
                name = f"state: {joint} {what} {when}"
                yield Injection(name, FaultSource.DATA, Expect.STOP, (reason,), 0.2, state=spoil)


def _gate() -> Iterator[Injection]:
    def slow(ticks: int) -> Callable[[FaultMoment, Any], None]:
        def hold(m: FaultMoment, rig: Any) -> None:
            rig.held = m.k % ticks != 0

        return hold

    def no_estimate(m: FaultMoment, rig: Any) -> None:
        rig._base.publish = lambda message: None

    for ticks in (2, 5):
        yield Injection(
            f"gate at {500 // ticks} Hz", FaultSource.DEVICE, Expect.BEAR, lasting=4.0, stands=True, gate=slow(ticks)
        )
        some, name = lambda m, p, n=ticks: [] if m.k % n else [p], f"state: 1 of {ticks} arrives"
        yield Injection(name, FaultSource.DATA, Expect.BEAR, lasting=4.0, stands=True, state=some)
    yield Injection(
        "no base estimate", FaultSource.DEVICE, Expect.SAFE, (Reason.BASE_STALE,), stands=True, gate=no_estimate
    )

    for share in (0.15, 0.5):
        name, reasons = f"a knee gives {100 * share:g} % of its torque", (*LIMITS, Reason.MOTOR_DEAD, Reason.BALANCE)
        feeble = weak(KNEE, lambda m, s=share: s)
        yield Injection(name, FaultSource.DEVICE, Expect.SAFE, reasons, motors=feeble)
