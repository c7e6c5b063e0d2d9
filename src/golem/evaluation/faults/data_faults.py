"""Faults of what the robot says of itself: its frames, its clock, its encoders, its IMU, its motors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from golem.evaluation.faults.command_faults import JOINTS, LIMITS
from golem.evaluation.faults.rig import Expect, FaultMoment, FaultSource, Frames, Injection, by_state
from golem.interfaces.payloads import Reason
from golem.robots.model.table import JOINT_INDEX
from golem.types import Array, Imu, LowState

FROZEN, ODD, IMU = (Reason.STATE_FROZEN,), (Reason.STATE_IMPLAUSIBLE,), (Reason.IMU_IMPLAUSIBLE,)
DAMAGED, STALE, JUMPED = (Reason.STATE_DAMAGED,), (Reason.STATE_STALE,), (Reason.STATE_JUMPED,)
LIMBS = {"all": slice(0, 27), "left leg": slice(0, 6), "right arm": slice(20, 27), "left arm": slice(13, 20)}
LOST = 0.052
"""Time in which lost or frozen data has to stop the robot [s]."""


def data_faults() -> Iterator[Injection]:
    """Yield every fault of the robot's data."""
    yield from _frames()
    yield from _clock()
    yield from _frozen()
    yield from _joints()
    yield from _imu()
    yield from _motors()


def _stop(name: str, reasons: tuple[Reason, ...], within: float = 0.006, **more: Any) -> Injection:
    return Injection(f"state: {name}", FaultSource.DATA, Expect.STOP, reasons, within, **more)


def _bear(name: str, **more: Any) -> Injection:
    return Injection(f"state: {name}", FaultSource.DATA, Expect.BEAR, stands=True, **more)


def _safe(name: str, reasons: tuple[Reason, ...], **more: Any) -> Injection:
    return Injection(f"state: {name}", FaultSource.DATA, Expect.SAFE, (*reasons, *LIMITS), **more)


def _frames() -> Iterator[Injection]:
    def flipped(payload: bytes) -> bytes:
        wrong = bytearray(payload)
        wrong[500] ^= 1
        return bytes(wrong)

    yield _bear("checksum wrong once", state=lambda m, p: [flipped(p) if m.k == 0 else p])
    yield _bear("checksum wrong in 1 of 100", state=lambda m, p: [p if m.k % 100 else flipped(p)])
    yield _stop("checksum wrong in 1 of 5", DAMAGED, 0.05, state=lambda m, p: [p if m.k % 5 else flipped(p)])
    yield _stop("checksum always wrong", DAMAGED, state=lambda m, p: [flipped(p)])
    yield _bear("truncated once", state=lambda m, p: [p[:-8] if m.k == 0 else p])
    yield _stop("truncated", DAMAGED, state=lambda m, p: [p[:-8]])
    yield _stop("random bytes", DAMAGED, state=lambda m, p: [p[:4] + m.rng.bytes(len(p) - 4)])
    yield _stop("silent", STALE, LOST, state=lambda m, p: [])
    yield _stop("the same frame for ever", STALE, 0.054, state=lambda m, p: [m.kept.setdefault("first", p)])
    yield _bear("half lost", state=lambda m, p: [p] if m.k % 2 else [])
    yield _bear("20 ms lost once", state=lambda m, p: [] if m.k < 10 else [p])
    yield _bear("every frame twice", state=lambda m, p: [p, p])
    for field in ("q", "dq", "tau_est"):
        for joint in (JOINTS[1], JOINTS[5]):
            for value in (np.nan, np.inf):

                def edit(
                    m: FaultMoment, image: Any, f: str = field, i: int = JOINT_INDEX[joint], v: float = value
                ) -> None:
                    image["motor"][f][i] = v

                yield _stop(f"{field} {value} {joint}", DAMAGED, state=by_state(edit))

    def pr(m: FaultMoment, image: Any) -> None:
        image["mode_pr"] = 1

    yield _stop("mode_pr 1", DAMAGED, state=by_state(pr))

    def zero(m: FaultMoment, image: Any) -> None:
        image["imu"]["quaternion"] = 0.0

    yield _stop("quaternion zero", DAMAGED, state=by_state(zero))


def _clock() -> Iterator[Injection]:
    for seconds in (-1.0, -10.0, 0.5, 10.0):

        def jump(m: FaultMoment, image: Any, by: int = round(1e3 * seconds)) -> None:
            image["tick"] = max(1, int(image["tick"]) + by)

        yield _stop(f"tick jumps by {seconds:+g} s", JUMPED, 0.002, state=by_state(jump))

    def slow(m: FaultMoment, image: Any) -> None:
        start = m.kept.setdefault("start", int(image["tick"]))
        image["tick"] = start + (int(image["tick"]) - start) // 2

    yield _safe("tick at half rate", (Reason.STATE_CLOCK, Reason.COMMAND_STALE), state=by_state(slow))

    def stands(m: FaultMoment, image: Any) -> None:
        image["tick"] = m.kept.setdefault("tick", int(image["tick"]))

    yield _stop("tick stands", STALE, 0.054, state=by_state(stands))


def _frozen() -> Iterator[Injection]:
    def keep(m: FaultMoment, state: LowState) -> LowState:
        return m.kept.setdefault("state", state)

    for limb, part in LIMBS.items():

        def freeze(m: FaultMoment, state: LowState, part: slice = part) -> LowState:
            old = keep(m, state)
            arrays = {name: getattr(state, name).copy() for name in ("q", "dq", "tau")}
            for name, array in arrays.items():
                array[part] = getattr(old, name)[part]
            return replace(state, **arrays)

        reasons = (*FROZEN, *ODD, Reason.MOTOR_DEAD)
        yield _stop(f"{limb} frozen", reasons, LOST, senses=freeze, stands="arm" in limb)
    yield _stop("everything frozen", FROZEN, LOST, senses=lambda m, s: replace(keep(m, s), t=s.t))
    yield _stop("IMU frozen", (*FROZEN, *IMU), LOST, senses=lambda m, s: replace(s, imu=keep(m, s).imu))

    def speeds(m: FaultMoment, state: LowState) -> LowState:
        return replace(state, dq=np.zeros(27))

    yield _safe("dq zero", ODD, senses=speeds)
    yield _safe("dq with the wrong sign", ODD, senses=lambda m, s: replace(s, dq=-s.dq))
    yield _safe("torques zero", (Reason.MOTOR_DEAD,), senses=lambda m, s: replace(s, tau=np.zeros(27)))


def _joints() -> Iterator[Injection]:
    for joint in JOINTS:
        i, leg = JOINT_INDEX[joint], JOINT_INDEX[joint] < 13

        def add(
            size: Callable[[FaultMoment], float], field: str = "q", i: int = i
        ) -> Callable[[FaultMoment, LowState], LowState]:
            def spoil(m: FaultMoment, state: LowState) -> LowState:
                array = getattr(state, field).copy()
                array[i] += size(m)
                return replace(state, **{field: array})

            return spoil

        yield _bear(f"{joint} +0.5 rad once", senses=add(lambda m: 0.5 if m.k == 0 else 0.0))
        yield _stop(f"{joint} +0.5 rad for ever", (*ODD, *LIMITS), 0.006, senses=add(lambda m: 0.5), stands=not leg)
        yield _stop(
            f"{joint} drifts by 0.1 rad/s",
            (*ODD, *LIMITS, Reason.MOTOR_DEAD),
            1.5,
            lasting=2.5,
            senses=add(lambda m: 0.1 * m.t),
            stands=False,
        )
        yield _stop(f"{joint} drifts by 1 rad/s", (*ODD, *LIMITS), 0.15, senses=add(lambda m: m.t), stands=False)
        yield _stop(f"{joint} dq +20 rad/s", (*ODD, *LIMITS), 0.052, senses=add(lambda m: 20.0, "dq"), stands=not leg)

    def swapped(m: FaultMoment, state: LowState) -> LowState:
        order = np.arange(27)
        order[[3, 9]] = order[[9, 3]]
        return replace(state, q=state.q[order], dq=state.dq[order], tau=state.tau[order])

    yield _safe("knees swapped", ODD, senses=swapped)

    def arms(m: FaultMoment, state: LowState) -> LowState:
        order = np.concatenate((np.arange(13), np.arange(20, 27), np.arange(13, 20)))
        return replace(state, q=state.q[order], dq=state.dq[order], tau=state.tau[order])

    yield _safe("arms swapped", ODD, senses=arms)


def _imu() -> Iterator[Injection]:
    def imu(change: Callable[[FaultMoment, Imu], Imu]) -> Callable[[FaultMoment, LowState], LowState]:
        return lambda m, state: replace(state, imu=change(m, state.imu))

    def rolled(angle: float, quat: Array) -> Array:
        c, s = np.cos(angle / 2), np.sin(angle / 2)
        w, x, y, z = quat
        return np.array([c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y])

    tilted = (*IMU, Reason.TILT)
    yield _stop("IMU upside down", tilted, 0.006, senses=imu(lambda m, u: replace(u, quat=rolled(np.pi, u.quat))))
    yield _stop("IMU 60 degrees off", tilted, 0.006, senses=imu(lambda m, u: replace(u, quat=rolled(1.05, u.quat))))
    yield _bear(
        "IMU 60 degrees off once", senses=imu(lambda m, u: replace(u, quat=rolled(1.05, u.quat)) if m.k == 0 else u)
    )
    for rate in (1.0, 0.2):
        yield _stop(
            f"gyro +{rate:g} rad/s",
            (*IMU, *LIMITS),
            1.2,
            lasting=2.0,
            senses=imu(lambda m, u, r=rate: replace(u, gyro=u.gyro + r)),
        )
    yield _stop("gyro 100 rad/s", (*IMU, *LIMITS), 0.1, senses=imu(lambda m, u: replace(u, gyro=u.gyro + 100.0)))
    yield _safe("gyro zero", IMU, senses=imu(lambda m, u: replace(u, gyro=np.zeros(3))))
    yield _stop("no specific force", IMU, 1.2, lasting=2.0, senses=imu(lambda m, u: replace(u, acc=0.0 * u.acc)))
    yield _stop("specific force inverted", IMU, 1.5, lasting=2.0, senses=imu(lambda m, u: replace(u, acc=-u.acc)))
    yield _safe(
        "roll drifts by 0.05 rad/s",
        IMU,
        lasting=3.0,
        senses=imu(lambda m, u: replace(u, quat=rolled(0.05 * m.t, u.quat))),
    )
    yield _stop(
        "roll drifts by 0.5 rad/s",
        (*IMU, *LIMITS),
        0.4,
        senses=imu(lambda m, u: replace(u, quat=rolled(0.5 * m.t, u.quat))),
    )


def _motors() -> Iterator[Injection]:
    def motor(field: str, value: Any, where: Any) -> Callable[[FaultMoment, bytes], Frames]:
        def edit(m: FaultMoment, image: Any) -> None:
            image["motor"][field][where] = value

        return by_state(edit)

    for joint in (JOINTS[1], JOINTS[5]):
        i = JOINT_INDEX[joint]
        yield _stop(f"{joint} reports an error", (Reason.MOTOR,), 0.062, state=motor("motorstate", 1, i))
        yield _stop(f"{joint} says it is off", (Reason.MOTOR_MODE,), 0.062, state=motor("mode", 0, i))
        for degrees in (200, -300):
            yield _stop(
                f"{joint} at {degrees} degrees", (Reason.MOTOR_HOT,), 0.062, state=motor("temperature", degrees, i)
            )
        for volts in (0.0, 1e6, np.nan):
            yield _stop(f"{joint} at {volts:g} V", (Reason.MOTOR_VOLTAGE,), 0.062, state=motor("vol", volts, i))

    def brief(m: FaultMoment, image: Any) -> None:
        image["motor"]["motorstate"][3] = 1 if m.k < 10 else 0

    yield _bear("a knee reports an error for 20 ms", state=by_state(brief))
