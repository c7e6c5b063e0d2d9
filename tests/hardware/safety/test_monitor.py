from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from golem.hardware.safety.base import Counters, SafetyLimits
from golem.hardware.safety.monitor import examine, finite, tilt, whole, whole_command
from golem.interfaces.payloads import GateState, GateStatus, Reason
from golem.types import LowCommand, LowState


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e7])
def test_one_bad_number_anywhere_is_found(bad: float) -> None:
    for index in range(27):
        array = np.full(27, 999.0)
        assert finite(array)
        array[index] = bad
        assert not finite(array)


@pytest.mark.parametrize("shape", [(26,), (28,), (27, 1), ()])
def test_a_wrong_shape_is_found(shape: tuple[int, ...]) -> None:
    assert not finite(np.zeros(shape))


@pytest.mark.parametrize("name", ["q", "dq", "tau"])
def test_every_array_of_the_state_is_looked_at(name: str, state_at: Callable[..., LowState]) -> None:
    assert whole(state_at(0.0))
    assert not whole(replace(state_at(0.0), **{name: np.full(27, np.nan)}))


@pytest.mark.parametrize(("name", "size"), [("quat", 4), ("gyro", 3), ("acc", 3)])
def test_every_array_of_the_imu_is_looked_at(name: str, size: int, state_at: Callable[..., LowState]) -> None:
    state = state_at(0.0)
    for index in range(size):
        array = np.array(getattr(state.imu, name))
        array[index] = np.nan
        assert not whole(replace(state, imu=replace(state.imu, **{name: array})))
    assert not whole(replace(state, imu=replace(state.imu, **{name: np.zeros(size + 1)})))


def test_a_quaternion_of_zeros_is_no_orientation(state_at: Callable[..., LowState]) -> None:
    assert not whole(state_at(0.0, quat=np.zeros(4)))


@pytest.mark.parametrize("name", ["q", "dq", "tau", "kp", "kd"])
def test_every_array_of_the_command_is_looked_at(name: str, command_at: Callable[..., LowCommand]) -> None:
    assert whole_command(command_at(0.0))
    assert not whole_command(replace(command_at(0.0), **{name: np.full(27, np.inf)}))


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.2, 3.0])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_tilt_is_the_angle_between_the_up_axes(angle: float, heading: float) -> None:
    # Heading about the vertical, then a roll: quaternion product (c_h, 0, 0, s_h) (c_a, s_a, 0, 0).
    ch, sh, ca, sa = np.cos(heading / 2), np.sin(heading / 2), np.cos(angle / 2), np.sin(angle / 2)
    assert tilt(np.array([ch * ca, ch * sa, sh * sa, sh * ca])) == pytest.approx(angle, abs=1e-7)


def persistent(state: LowState, limits: SafetyLimits, samples: int) -> list[Reason | None]:
    counters, reasons = Counters(), []
    for _ in range(samples):
        counters, fault = examine(state, limits, counters)
        reasons.append(fault.reason if fault else None)
    return reasons


JOINT = 16  # left elbow


def violations(limits: SafetyLimits) -> dict[Reason, dict[str, np.ndarray]]:
    def at(value: float) -> np.ndarray:
        array = np.zeros(27)
        array[JOINT] = value
        return array

    return {
        Reason.POSITION: {"q": at(limits.state_upper[JOINT] + 0.01)},
        Reason.VELOCITY: {"dq": at(-limits.velocity[JOINT] * 1.05)},
        Reason.TORQUE: {"tau": at(-limits.torque[JOINT] * 1.01)},
        # 0.3 rad before the limit at 5 rad/s: 5^2 / (2 20) = 0.6 rad are needed.
        Reason.BRAKING: {"q": at(limits.state_upper[JOINT] - 0.3), "dq": at(5.0)},
        Reason.TILT: {"quat": np.array([np.cos(0.45), np.sin(0.45), 0.0, 0.0])},
    }


@pytest.mark.parametrize("reason", [Reason.POSITION, Reason.VELOCITY, Reason.TORQUE, Reason.BRAKING, Reason.TILT])
def test_a_violation_must_persist(reason: Reason, limits: SafetyLimits, state_at: Callable[..., LowState]) -> None:
    needed = limits.torque_samples if reason is Reason.TORQUE else limits.samples
    changes = violations(limits)[reason]
    reasons = persistent(state_at(0.0, **changes), limits, needed)
    assert reasons == [None] * (needed - 1) + [reason]


@pytest.mark.parametrize("reason", [Reason.POSITION, Reason.VELOCITY, Reason.BRAKING])
def test_legs_may_be_fast_or_at_their_stop_for_longer_because_feet_touch_down(
    reason: Reason, limits: SafetyLimits, state_at: Callable[..., LowState]
) -> None:
    knee = 3
    q, dq = np.zeros(27), np.zeros(27)
    if reason is Reason.POSITION:
        q[knee] = limits.state_upper[knee] + 0.02
    elif reason is Reason.VELOCITY:
        dq[knee] = 1.05 * limits.velocity[knee]
    else:
        q[knee], dq[knee] = limits.state_upper[knee] - 0.1, 0.9 * limits.velocity[knee]
    reasons = persistent(state_at(0.0, q=q, dq=dq), limits, limits.leg_samples)
    assert reasons == [None] * (limits.leg_samples - 1) + [reason]


def test_a_sound_sample_in_between_starts_the_count_again(
    limits: SafetyLimits, state_at: Callable[..., LowState]
) -> None:
    bad = state_at(0.0, **violations(limits)[Reason.VELOCITY])
    counters = Counters()
    for _ in range(10):
        counters, fault = examine(bad, limits, counters)
        assert fault is None
        counters, fault = examine(bad, limits, counters)
        assert fault is None
        counters, fault = examine(state_at(0.0), limits, counters)
        assert counters == Counters()


def test_a_gross_violation_needs_one_sample_and_names_its_joint(
    limits: SafetyLimits, state_at: Callable[..., LowState]
) -> None:
    dq = np.zeros(27)
    dq[JOINT] = 4.0 * limits.velocity[JOINT]
    _, fault = examine(state_at(0.0, dq=dq), limits, Counters())
    assert fault is not None
    assert fault.reason is Reason.VELOCITY
    assert "left_elbow_joint" in fault.detail


def test_moving_away_from_a_limit_is_no_braking_fault(limits: SafetyLimits, state_at: Callable[..., LowState]) -> None:
    q, dq = np.zeros(27), np.zeros(27)
    q[JOINT], dq[JOINT] = limits.state_upper[JOINT] - 0.01, -5.0
    assert persistent(state_at(0.0, q, dq=dq), limits, 5) == [None] * 5


@pytest.mark.parametrize(
    ("reason", "detail", "why"),
    [
        (Reason.TILT, "torso at 46 degrees", "tilt: torso at 46 degrees"),
        (Reason.REQUESTED, "", "stop_requested"),
        (None, "", ""),
    ],
)
def test_a_status_says_why_in_one_line(reason: Reason | None, detail: str, why: str) -> None:
    assert GateStatus(0.0, GateState.STOP1, reason, detail).why == why


@pytest.mark.parametrize(
    ("beside", "samples", "stands"), [(None, 3, True), (4, 3, True), (12, 3, False), (4, 25, False)]
)
def test_an_arm_that_is_too_fast_leaves_legs_sound_that_are_wrong_for_a_moment(
    beside: int | None, samples: int, stands: bool, state_at: Callable[..., LowState]
) -> None:
    """Joint 4 is an ankle, which may be too fast for 25 samples; joint 12 is the torso's."""
    limits, counters, fault = SafetyLimits.from_profile(), Counters(), None
    dq = np.zeros(27)
    if beside is not None:
        dq[beside] = 1.1 * limits.velocity[beside]
    for k in range(samples):
        if k >= samples - limits.samples:
            dq[16] = 1.1 * limits.velocity[16]
        counters, fault = examine(replace(state_at(0.0), dq=dq), limits, counters)
    assert fault is not None and fault.reason is Reason.VELOCITY and fault.stands is stands
