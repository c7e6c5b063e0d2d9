"""Sensors that have stopped measuring, or say what cannot be true, are found out; those of a robot at work are not."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.senses import SensesMemory, sense
from golem.interfaces.payloads import Fault, Reason
from golem.types import Imu, LowCommand, LowState

LIMITS = SafetyLimits.from_profile()
DT = 0.002
ZERO = np.zeros(27)
Spoil = Callable[[float, LowState], LowState]


def working(k: int, rng: np.random.Generator) -> LowState:
    """A robot whose joints swing by 0.3 rad at 1 Hz, with the noise of real sensors."""
    t = k * DT
    w = 2.0 * np.pi
    q = 0.3 * np.sin(w * t) + 1e-5 * rng.standard_normal(27)
    dq = 0.3 * w * np.cos(w * t) + 1e-2 * rng.standard_normal(27)
    shake = rng.standard_normal((2, 3))
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), 4e-3 * shake[0], np.array([0.0, 0.0, 9.81]) + 0.03 * shake[1])
    return LowState(t, q, dq, rng.standard_normal(27), imu)


def run(
    spoil: Spoil | None = None, sent: LowCommand | None = None, seconds: float = 2.0
) -> tuple[Fault | None, float, int]:
    """Return the first fault, its time since spoiling began (after 0.5 s), and how many samples were dropped."""
    rng, memory, dropped = np.random.default_rng(0), SensesMemory(), 0
    for k in range(round((0.5 + seconds) / DT)):
        state = working(k, rng)
        since = k * DT - 0.5
        if spoil is not None and since >= 0.0:
            state = spoil(since, state)
        memory, believed, fault = sense(state, k * DT, memory, LIMITS, sent)
        dropped += not believed
        if fault is not None:
            return fault, since, dropped
    return None, 0.0, dropped


def part(name: str, where: slice, value: Callable[[float], float], keep: bool = True) -> Spoil:
    """Return what adds to, or replaces, a part of an array of the state."""

    def spoil(t: float, state: LowState) -> LowState:
        array = getattr(state, name).copy()
        array[where] = keep * array[where] + value(t)
        return replace(state, **{name: array})

    return spoil


def test_a_robot_at_work_is_believed() -> None:
    assert run() == (None, 0.0, 0)


@pytest.mark.parametrize(("limb", "stands"), [(slice(0, 6), False), (slice(13, 20), True), (slice(0, 27), False)])
def test_a_limb_that_repeats_its_numbers_is_frozen_within_50_ms(limb: slice, stands: bool) -> None:
    old: list[LowState] = []

    def freeze(t: float, state: LowState) -> LowState:
        old.append(state)
        arrays = {name: getattr(state, name).copy() for name in ("q", "dq", "tau")}
        for name, array in arrays.items():
            array[limb] = getattr(old[0], name)[limb]
        return replace(state, **arrays)

    fault, after, _ = run(freeze)
    assert fault is not None and fault.reason is Reason.STATE_FROZEN
    assert after <= LIMITS.frozen + 1e-9 and fault.stands is stands


def test_sensors_declared_still_may_stand_still() -> None:
    memory, state = SensesMemory(), working(0, np.random.default_rng(0))
    state = replace(state, dq=ZERO)
    for k in range(200):
        memory, _, fault = sense(state, k * DT, memory, LIMITS.still(), None)
        assert fault is None


def test_one_sample_that_jumps_is_dropped_and_a_run_of_them_is_a_fault() -> None:
    once = part("q", slice(16, 17), lambda t: 0.5 if t < DT / 2 else 0.0)
    sent = LowCommand(0.0, ZERO, ZERO, ZERO, ZERO, ZERO)
    assert run(once, sent) == (None, 0.0, 1)
    fault, after, dropped = run(part("q", slice(16, 17), lambda t: 0.5), sent)
    assert fault is not None and fault.reason is Reason.STATE_IMPLAUSIBLE
    assert dropped == 3 and after <= 0.0041 and fault.stands


def rolled(angle: float, until: float) -> Spoil:
    """Roll the IMU by an angle [rad] until a time [s]."""
    off = np.array([math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0])
    return lambda t, s: replace(s, imu=replace(s.imu, quat=off)) if t < until else s


def test_an_orientation_that_jumps_once_is_dropped_and_one_that_stays_there_stops() -> None:
    sent = LowCommand(0.0, ZERO, ZERO, ZERO, ZERO, ZERO)
    assert run(rolled(1.05, DT / 2), sent) == (None, 0.0, 1)
    fault, after, dropped = run(rolled(1.05, math.inf), sent)
    assert fault is not None and fault.reason is Reason.IMU_IMPLAUSIBLE and dropped == 3 and after <= 0.0041


@pytest.mark.parametrize(
    ("spoil", "reason", "within"),
    [
        (part("q", slice(3, 4), lambda t: 0.1 * t), Reason.STATE_IMPLAUSIBLE, 1.5),
        (part("dq", slice(3, 4), lambda t: 20.0), Reason.STATE_IMPLAUSIBLE, 0.052),
        (lambda t, s: replace(s, dq=-s.dq), Reason.STATE_IMPLAUSIBLE, 0.5),
        (lambda t, s: replace(s, imu=replace(s.imu, gyro=s.imu.gyro + 1.0)), Reason.IMU_IMPLAUSIBLE, 0.2),
        (lambda t, s: replace(s, imu=replace(s.imu, acc=0.01 * s.imu.acc)), Reason.IMU_IMPLAUSIBLE, 1.0),
    ],
)
def test_what_cannot_be_true_is_a_fault(spoil: Spoil, reason: Reason, within: float) -> None:
    fault, after, _ = run(spoil)
    assert fault is not None and fault.reason is reason and after <= within


def test_a_motor_without_the_torque_it_is_asked_for_does_not_follow() -> None:
    tau = np.zeros(27)
    tau[3] = 100.0
    sent = LowCommand(0.0, ZERO, ZERO, tau, ZERO, ZERO)
    fault, after, _ = run(part("tau", slice(3, 4), lambda t: 100.0), sent)
    assert fault is not None and fault.reason is Reason.MOTOR_DEAD, "before 0.5 s it had none"
    rng, memory = np.random.default_rng(0), SensesMemory()
    for k in range(500):
        state = part("tau", slice(3, 4), lambda t: 100.0)(0.0, working(k, rng))
        memory, _, fault = sense(state, k * DT, memory, LIMITS, sent)
        assert fault is None
