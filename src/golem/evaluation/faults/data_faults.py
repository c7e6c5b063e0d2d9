"""Faults of what the robot says of itself: its frames, its clock, its encoders, its IMU, its motors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import chain, product
from typing import Any

import numpy as np

from golem.evaluation.faults.command_faults import JOINTS, LIMITS
from golem.evaluation.faults.rig import Expect, FaultMoment, FaultSource, Injection, by_state
from golem.evaluation.faults.spoils import Senses, by_imu, frame_faults, reordered, set_to, shifted, turned
from golem.interfaces.payloads import Reason
from golem.robots.model.table import JOINT_INDEX
from golem.types import LowState

FROZEN, ODD, IMU = (Reason.STATE_FROZEN,), (Reason.STATE_IMPLAUSIBLE,), (Reason.IMU_IMPLAUSIBLE,)
DAMAGED, STALE, JUMPED = (Reason.STATE_DAMAGED,), (Reason.STATE_STALE,), (Reason.STATE_JUMPED,)
LIMBS = {"all": slice(0, 27), "left leg": slice(0, 6), "right arm": slice(20, 27), "left arm": slice(13, 20)}
LOST = 0.052
"""Time in which lost or frozen data has to stop the robot [s]."""


def data_faults() -> Iterator[Injection]:
    """Return every fault of the robot's data."""
    return chain(_frames(), _clock(), _frozen(), _joints(), _imu(), _motors())


def _stop(name: str, reasons: tuple[Reason, ...], within: float = 0.006, **more: Any) -> Injection:
    return Injection(f"state: {name}", FaultSource.DATA, Expect.STOP, reasons, within, **more)


def _bear(name: str, **more: Any) -> Injection:
    return Injection(f"state: {name}", FaultSource.DATA, Expect.BEAR, stands=True, **more)


def _safe(name: str, reasons: tuple[Reason, ...], **more: Any) -> Injection:
    return Injection(f"state: {name}", FaultSource.DATA, Expect.SAFE, (*reasons, *LIMITS), **more)


def _frames() -> Iterator[Injection]:
    yield from frame_faults("state", 500, partial(_stop, reasons=DAMAGED), _bear)
    yield _stop("silent", STALE, LOST, state=lambda m, p: [])
    yield _stop("the same frame for ever", STALE, 0.054, state=lambda m, p: [m.kept.setdefault("first", p)])
    yield _bear("20 ms lost once", state=lambda m, p: [] if m.k < 10 else [p])
    for field, joint, value in product(("q", "dq", "tau_est"), (JOINTS[1], JOINTS[5]), (np.nan, np.inf)):
        edit = set_to(value, "motor", field, JOINT_INDEX[joint])
        yield _stop(f"{field} {value} {joint}", DAMAGED, state=by_state(edit))
    yield _stop("mode_pr 1", DAMAGED, state=by_state(set_to(1, "mode_pr")))
    yield _stop("quaternion zero", DAMAGED, state=by_state(set_to(0.0, "imu", "quaternion")))


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

    yield _safe("dq zero", ODD, senses=lambda m, s: replace(s, dq=np.zeros(27)))
    yield _safe("dq with the wrong sign", ODD, senses=lambda m, s: replace(s, dq=-s.dq))
    yield _safe("torques zero", (Reason.MOTOR_DEAD,), senses=lambda m, s: replace(s, tau=np.zeros(27)))


def _joints() -> Iterator[Injection]:
    off = (*ODD, *LIMITS)
    for joint in JOINTS:
        i, leg = JOINT_INDEX[joint], JOINT_INDEX[joint] < 13
        drifts = partial(_stop, lasting=2.5, senses=shifted(i, lambda m: 0.1 * m.t), stands=False)
        yield _bear(f"{joint} +0.5 rad once", senses=shifted(i, lambda m: 0.5 if m.k == 0 else 0.0))
        yield _stop(f"{joint} +0.5 rad for ever", off, 0.006, senses=shifted(i, lambda m: 0.5), stands=not leg)
        yield drifts(f"{joint} drifts by 0.1 rad/s", (*off, Reason.MOTOR_DEAD), 1.5)
        yield _stop(f"{joint} drifts by 1 rad/s", off, 0.15, senses=shifted(i, lambda m: m.t), stands=False)
        yield _stop(f"{joint} dq +20 rad/s", off, 0.052, senses=shifted(i, lambda m: 20.0, "dq"), stands=not leg)
    knees = list(range(27))
    knees[3], knees[9] = 9, 3
    yield _safe("knees swapped", ODD, senses=reordered(knees))
    arms = (*range(13), *range(20, 27), *range(13, 20))
    yield _safe("arms swapped", ODD, senses=reordered([*arms]))


def _imu() -> Iterator[Injection]:
    def rolled(angle: Callable[[FaultMoment], float]) -> Senses:
        return by_imu(lambda m, u: replace(u, quat=turned(0, angle(m), u.quat)))

    def spun(rate: float) -> Senses:
        return by_imu(lambda m, u: replace(u, gyro=u.gyro + rate))

    tilted, moved = (*IMU, Reason.TILT), (*IMU, *LIMITS)
    yield _stop("IMU upside down", tilted, 0.006, senses=rolled(lambda m: np.pi))
    yield _stop("IMU 60 degrees off", tilted, 0.006, senses=rolled(lambda m: 1.05))
    yield _bear("IMU 60 degrees off once", senses=rolled(lambda m: 1.05 if m.k == 0 else 0.0))
    for rate in (1.0, 0.2):
        yield _stop(f"gyro +{rate:g} rad/s", moved, 1.2, lasting=2.0, senses=spun(rate))
    yield _stop("gyro 100 rad/s", moved, 0.1, senses=spun(100.0))
    yield _safe("gyro zero", IMU, senses=by_imu(lambda m, u: replace(u, gyro=np.zeros(3))))
    yield _stop("no specific force", IMU, 1.2, lasting=2.0, senses=by_imu(lambda m, u: replace(u, acc=0.0 * u.acc)))
    yield _stop("specific force inverted", IMU, 1.5, lasting=2.0, senses=by_imu(lambda m, u: replace(u, acc=-u.acc)))
    yield _safe("roll drifts by 0.05 rad/s", IMU, lasting=3.0, senses=rolled(lambda m: 0.05 * m.t))
    yield _stop("roll drifts by 0.5 rad/s", moved, 0.4, senses=rolled(lambda m: 0.5 * m.t))


def _motors() -> Iterator[Injection]:
    for joint in (JOINTS[1], JOINTS[5]):
        rows: list[tuple[str, str, Any, Reason]] = [
            ("reports an error", "motorstate", 1, Reason.MOTOR),
            ("says it is off", "mode", 0, Reason.MOTOR_MODE),
            *((f"at {degrees} degrees", "temperature", degrees, Reason.MOTOR_HOT) for degrees in (200, -300)),
            *((f"at {volts:g} V", "vol", volts, Reason.MOTOR_VOLTAGE) for volts in (0.0, 1e6, np.nan)),
        ]
        for what, field, value, reason in rows:
            edit = set_to(value, "motor", field, JOINT_INDEX[joint])
            yield _stop(f"{joint} {what}", (reason,), 0.062, state=by_state(edit))
    brief = set_to(lambda m: 1 if m.k < 10 else 0, "motor", "motorstate", 3)
    yield _bear("a knee reports an error for 20 ms", state=by_state(brief))
