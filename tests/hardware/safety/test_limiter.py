from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.hardware.safety.base import Outgoing, SafetyLimits
from golem.hardware.safety.limiter import BRAKE, limit_command, spared
from golem.types import Array, Imu, LowCommand, LowState

DT = 0.002
LIMITS = SafetyLimits.from_profile()


def predicted(command: LowCommand, state: LowState) -> Array:
    return command.kp * (command.q - state.q) + command.kd * (command.dq - state.dq) + command.tau


def at_rest(limits: SafetyLimits, q: Array | None = None, gains: float = 1e3) -> Outgoing:
    """Return a last command at `q` whose gains need not rise any more."""
    return Outgoing(np.zeros(27) if q is None else q, np.full(27, gains), np.full(27, gains))


def test_an_ordinary_command_passes_unchanged(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    command = command_at(0.0, np.full(27, 0.004), tau=np.full(27, 2.0))
    sent, _ = limit_command(0.0, state_at(0.0), command, limits, at_rest(limits), DT)
    for name in ("q", "dq", "tau", "kp", "kd"):
        np.testing.assert_array_equal(getattr(sent, name), getattr(command, name))


def test_a_legal_but_far_target_is_no_step(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    far = np.clip(np.full(27, 1.0), limits.lower, limits.upper)
    sent, _ = limit_command(0.0, state_at(0.0), command_at(0.0, far), limits, at_rest(limits), DT)
    assert np.all(np.abs(sent.q) <= limits.slew * DT + 1e-15)
    assert sent.q[16] == pytest.approx(0.006)


def test_a_blocked_joint_stores_no_spring(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    blocked, target, last = state_at(0.0), np.zeros(27), at_rest(limits)
    target[16] = 2.0
    for _ in range(1000):
        sent, last = limit_command(0.0, blocked, command_at(0.0, target), limits, last, DT)
    assert sent.q[16] == pytest.approx(limits.torque_command[16] / 100.0)
    assert predicted(sent, blocked)[16] == pytest.approx(limits.torque_command[16])


def test_gravity_survives_a_spring_that_asks_too_much(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    tau = np.zeros(27)
    tau[16] = -10.0
    q = np.zeros(27)
    q[16] = -0.5
    sent, _ = limit_command(0.0, state_at(0.0), command_at(0.0, q, tau=tau), limits, at_rest(limits, q), DT)
    assert sent.tau[16] == -10.0
    assert predicted(sent, state_at(0.0))[16] == pytest.approx(-limits.torque_command[16])


def test_the_target_slows_down_towards_the_end_of_the_range(
    limits: SafetyLimits, command_at: Callable[..., LowCommand], state_at: Callable[..., LowState]
) -> None:
    q, speeds = np.zeros(27), []
    last = at_rest(limits, q)
    for _ in range(1500):
        sent, new = limit_command(0.0, state_at(0.0, last.q), command_at(0.0, np.full(27, 9.0)), limits, last, DT)
        speeds.append((new.q[16] - last.q[16]) / DT)
        distance = limits.upper[16] - last.q[16]
        assert speeds[-1] ** 2 <= 2.0 * limits.deceleration[16] * distance + 1e-6
        last = new
    assert max(speeds) == pytest.approx(3.0)
    assert last.q[16] == pytest.approx(limits.upper[16])


def test_gains_rise_slowly_and_fall_at_once(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    state, zero = state_at(0.0), np.zeros(27)
    sent, last = limit_command(0.0, state, command_at(0.0), limits, Outgoing(zero, zero, zero), DT)
    np.testing.assert_allclose(sent.kp, limits.kp_rate * DT)
    np.testing.assert_allclose(sent.kd, limits.kd_rate * DT)
    sent, _ = limit_command(0.0, state, command_at(0.0, kp=zero, kd=zero), limits, last, DT)
    assert not sent.kp.any() and not sent.kd.any()


def test_negative_gains_become_zero(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    command = command_at(0.0, kp=np.full(27, -50.0), kd=np.full(27, -5.0))
    sent, _ = limit_command(0.0, state_at(0.0), command, limits, at_rest(limits), DT)
    assert not sent.kp.any() and not sent.kd.any()


ANY = st.one_of(st.floats(-5.0, 5.0), st.floats(-1000.0, 1000.0), st.floats(-1e6, 1e6))


@given(
    q=st.floats(-4.0, 4.0),
    dq=st.floats(-60.0, 60.0),
    command=st.tuples(ANY, ANY, ANY, ANY, ANY),
    last=st.tuples(st.floats(-4.0, 4.0), st.floats(0.0, 500.0), st.floats(0.0, 30.0)),
)
def test_no_command_breaks_a_limit(
    q: float, dq: float, command: tuple[float, ...], last: tuple[float, float, float]
) -> None:
    def full(value: float) -> Array:
        return np.full(27, value)

    state = LowState(0.0, full(q), full(dq), full(0.0), Imu(np.eye(4)[0], np.zeros(3), np.zeros(3)))
    before = Outgoing(*(full(value) for value in last))
    sent, after = limit_command(0.0, state, LowCommand(0.0, *(full(v) for v in command)), LIMITS, before, DT)
    bound = LIMITS.torque_command
    torque = predicted(sent, state)
    for array in (sent.q, sent.dq, sent.tau, sent.kp, sent.kd):
        assert np.isfinite(array).all()
    assert np.all(np.abs(torque) <= bound * (1 + 1e-9) + 1e-9)
    assert np.all(np.abs(sent.tau) <= bound * (1 + 1e-12))
    assert np.all(np.abs(sent.dq) <= LIMITS.velocity)
    assert np.all((sent.kp >= 0) & (sent.kp <= np.minimum(LIMITS.kp_max, before.kp + LIMITS.kp_rate * DT)))
    assert np.all((sent.kd >= 0) & (sent.kd <= np.minimum(LIMITS.kd_max, before.kd + LIMITS.kd_rate * DT)))
    # A position may move faster than the slew limit only if the torque limit pulls it towards the measured one.
    quick = np.abs(sent.q - before.q) > LIMITS.slew * DT * (1 + 1e-9) + 1e-12
    assert np.all(np.abs(sent.q - q)[quick] <= np.abs(before.q - q)[quick])
    np.testing.assert_allclose(np.abs(torque)[quick], bound[quick], rtol=1e-6)
    np.testing.assert_array_equal(after.q, sent.q)


def test_the_receiver_cannot_reach_into_the_memory(
    limits: SafetyLimits, state_at: Callable[..., LowState], command_at: Callable[..., LowCommand]
) -> None:
    sent, last = limit_command(0.0, state_at(0.0), command_at(0.0), limits, at_rest(limits), DT)
    sent.q[:] = sent.kp[:] = sent.kd[:] = 9.0
    assert not (last.q == 9.0).any() and not (last.kp == 9.0).any() and not (last.kd == 9.0).any()


@pytest.mark.parametrize(("dq", "share"), [(0.0, 1.0), (0.75, 1.0), (0.9, 0.5), (1.0, 0.0), (2.0, -BRAKE)])
def test_a_joint_near_its_speed_is_driven_on_less_and_braked_beyond(dq: float, share: float) -> None:
    up, down = spared(
        np.zeros(1), np.array([10.0 * dq]), np.array([1e6]), np.array([10.0]), np.array([-1.0]), np.array([1.0])
    )
    assert up[0] == pytest.approx(share) and down[0] == 1.0


def test_a_joint_near_the_end_of_its_range_is_driven_on_less_and_braked_beyond() -> None:
    ends = np.array([-1.0, -1.0, -1.0]), np.array([1.0, 1.0, 1.0])
    up, down = spared(np.array([0.9, 0.975, 1.2]), np.zeros(3), np.ones(3), np.ones(3), *ends)
    assert up == pytest.approx([1.0, 0.5, -BRAKE]) and down == pytest.approx(1.0)


def test_no_command_drives_a_fast_joint_on() -> None:
    state = LowState(0.0, np.zeros(27), LIMITS.velocity, np.zeros(27), Imu(np.eye(4)[0], np.zeros(3), np.zeros(3)))
    command = LowCommand(0.0, np.zeros(27), np.zeros(27), LIMITS.torque, np.zeros(27), np.zeros(27))
    sent, _ = limit_command(0.0, state, command, LIMITS, at_rest(LIMITS), DT, strained=True)
    assert np.all(predicted(sent, state) <= 1e-9)
