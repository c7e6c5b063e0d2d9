from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.hardware.estop.estop_config import VirtualEstop
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.hardware.servo.base import MotorServo
from golem.hardware.servo.servo import Servo, ServoConfig
from golem.interfaces.payloads import GateState
from golem.types import Array, LowState

DT = 0.002
READY = np.zeros(27)
READY[[13, 16, 20, 23]] = [-0.9, 0.6, -0.9, 0.6]
"""Both hands in front of the body: the posture in which a payload sags most."""
ELBOW = 16


def settled(servo: Servo, state: LowState, q_cmd: Array, ticks: int = 1) -> Any:
    """Run the servo past its ramp, then `ticks` more; returns the last command."""
    servo.reset(state)
    command = servo.step(state, state.q, servo.config.ramp)
    for _ in range(ticks):
        command = servo.step(state, q_cmd, DT)
    return command


def hold(plant: Any, servo: Servo, q_cmd: Array, seconds: float) -> Array:
    """Let the servo hold `q_cmd` in simulation; returns the error (27,) at the end."""
    for _ in range(round(seconds / DT)):
        plant.advance(servo.step(plant.state(), q_cmd, DT))
    return q_cmd - plant.state().q


def test_it_is_a_motor_servo() -> None:
    assert isinstance(Servo(), MotorServo)


def test_the_command_is_the_papers(state_at: Callable[..., LowState]) -> None:
    servo = Servo(ServoConfig(integral=False))
    q_cmd = READY + 0.01
    command = settled(servo, state_at(1.5, READY), q_cmd)
    np.testing.assert_array_equal(command.q, q_cmd)
    assert not command.dq.any()
    np.testing.assert_array_equal(command.kp, servo.gains.kp)
    np.testing.assert_array_equal(command.kd, servo.gains.kd)
    assert command.t == 1.5
    # Forearm and hand, some 2 kg at 0.3 m, held level: the elbow must push up (negative about y).
    assert -12.0 < command.tau[ELBOW] < -2.0


def test_stiffness_ramps_up_while_gravity_is_carried_from_the_first_tick(state_at: Callable[..., LowState]) -> None:
    servo = Servo(ServoConfig(ramp=1.0))
    state = state_at(0.0, READY)
    servo.reset(state)
    commands = [servo.step(state, READY, DT) for _ in range(600)]
    stiffness = np.array([c.kp[ELBOW] for c in commands]) / servo.gains.kp[ELBOW]
    np.testing.assert_allclose(stiffness, np.minimum(np.arange(1, 601) * DT, 1.0), atol=1e-9)
    np.testing.assert_array_equal(commands[0].tau, commands[-1].tau)
    np.testing.assert_array_equal(commands[0].kd, servo.gains.kd)


def test_the_bias_rests_during_the_ramp(state_at: Callable[..., LowState]) -> None:
    servo, state = Servo(), state_at(0.0, READY)
    servo.reset(state)
    for _ in range(100):
        servo.step(state, READY + 0.01, DT)
    assert not servo.bias.any()


def test_the_bias_integrates_the_error(state_at: Callable[..., LowState]) -> None:
    servo, q_cmd = Servo(), READY.copy()
    q_cmd[ELBOW] += 0.01
    settled(servo, state_at(0.0, READY), q_cmd, ticks=100)
    expected = np.zeros(27)
    expected[ELBOW] = servo.gains.ki[ELBOW] * 0.01 * 100 * DT
    np.testing.assert_allclose(servo.bias, expected, atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_bias_is_clamped(sign: float, state_at: Callable[..., LowState]) -> None:
    servo, q_cmd = Servo(), READY.copy()
    q_cmd[ELBOW] += sign * 0.02
    settled(servo, state_at(0.0, READY), q_cmd, ticks=5000)
    assert servo.bias[ELBOW] == pytest.approx(sign * servo.gains.bias[ELBOW])


@pytest.mark.parametrize(("error", "speed"), [(0.11, 0.0), (0.01, 0.05), (0.01, -0.05)])
def test_a_joint_that_moves_or_is_far_away_does_not_integrate(
    error: float, speed: float, state_at: Callable[..., LowState]
) -> None:
    servo, q_cmd, dq = Servo(), READY.copy(), np.zeros(27)
    q_cmd[[ELBOW, 13]] += [error, 0.01]
    dq[ELBOW] = speed
    settled(servo, state_at(0.0, READY, dq=dq), q_cmd, ticks=100)
    assert servo.bias[ELBOW] == 0.0
    assert servo.bias[13] > 0.1


def test_a_saturated_joint_does_not_wind_up_further(state_at: Callable[..., LowState]) -> None:
    servo, q_cmd = Servo(), READY.copy()
    servo.gains.kp[ELBOW] = 1000.0  # 0.05 rad ask for 50 N m of the 15 there are
    q_cmd[[ELBOW, 13]] += 0.05
    settled(servo, state_at(0.0, READY), q_cmd, ticks=50)
    assert servo.bias[ELBOW] == 0.0
    assert servo.bias[13] > 0.1


def test_a_saturated_joint_may_unwind(state_at: Callable[..., LowState]) -> None:
    servo, q_cmd = Servo(), READY.copy()
    servo.gains.kp[ELBOW], servo.gains.bias[ELBOW] = 0.0, 50.0
    settled(servo, state_at(0.0, READY), READY)
    servo.bias[ELBOW] = 40.0
    q_cmd[ELBOW] -= 0.05
    for _ in range(50):
        servo.step(state_at(0.0, READY), q_cmd, DT)
    assert servo.bias[ELBOW] < 39.0


def test_reset_forgets_bias_and_starts_the_ramp(state_at: Callable[..., LowState]) -> None:
    servo, q_cmd = Servo(), READY + 0.02
    settled(servo, state_at(0.0, READY), q_cmd, ticks=100)
    assert servo.bias.any()
    servo.reset(state_at(0.0, READY))
    assert not servo.bias.any()
    assert np.all(servo.step(state_at(0.0, READY), q_cmd, DT).kp < 1.0)


def test_legs_take_the_gains_of_their_controller(state_at: Callable[..., LowState]) -> None:
    servo, own = Servo(), (np.full(12, 123.0), np.full(12, 4.5))
    servo.reset(state_at(0.0))
    command = servo.step(state_at(0.0), np.zeros(27), 2.0, leg_gains=own)
    np.testing.assert_array_equal(command.kp[:12], own[0])
    np.testing.assert_array_equal(command.kd[:12], own[1])
    np.testing.assert_array_equal(command.kp[12:], servo.gains.kp[12:])


def test_legs_that_carry_the_robot_are_stiff_at_once_under_the_torque_of_their_controller(
    state_at: Callable[..., LowState],
) -> None:
    servo, tau = Servo(), np.linspace(-60.0, 60.0, 12)
    own = np.full(12, 123.0), np.full(12, 4.5)
    state = state_at(0.0, READY)
    hanging = settled(servo, state, READY, ticks=50)
    servo.reset(state)
    first = servo.step(state, READY, DT, own, tau)
    np.testing.assert_array_equal(first.kp[:12], own[0])
    np.testing.assert_array_equal(first.tau[:12], tau)
    # The arms know nothing of it: they still ramp, and float on their own gravity torque.
    assert np.all(first.kp[12:] < 0.01 * servo.gains.kp[12:])
    np.testing.assert_allclose(first.tau[12:], hanging.tau[12:], atol=1e-12)
    later = servo.step(state, READY + 0.01, 2.0, own, tau)
    np.testing.assert_array_equal(later.tau[:12], tau)


def test_an_unknown_limit_profile_is_named() -> None:
    with pytest.raises(ConfigError, match="paper"):
        Servo(ServoConfig(limits="papr"))


def test_the_integral_removes_the_sag_of_an_unknown_payload(plant: Any) -> None:
    sag = {}
    for integral in (True, False):
        robot, servo = plant(payload=1.0), Servo(ServoConfig(integral=integral, ramp=0.1))
        robot.place(READY)
        servo.reset(robot.state())
        sag[integral] = np.abs(hold(robot, servo, READY, 3.0))
    assert sag[False].max() > 0.020
    # 1 mrad over the 0.6 m of an arm is 0.6 mm.
    assert sag[True].max() < 0.001


def test_without_payload_the_model_alone_holds_the_arms(plant: Any) -> None:
    robot, servo = plant(), Servo(ServoConfig(integral=False, ramp=0.1))
    robot.place(READY)
    servo.reset(robot.state())
    assert np.abs(hold(robot, servo, READY, 1.0)).max() < 0.001


def test_raised_arms_float_while_the_stiffness_is_still_low(plant: Any) -> None:
    robot, servo = plant(), Servo(ServoConfig(ramp=1000.0))
    robot.place(READY)
    servo.reset(robot.state())
    assert np.abs(hold(robot, servo, READY, 1.0)).max() < 0.01


def test_servo_and_gate_move_the_arms_and_the_gate_does_not_interfere(plant: Any, limits: SafetyLimits) -> None:
    robot, servo, gate, estop = plant(), Servo(ServoConfig(ramp=0.5)), Gate(limits), VirtualEstop()
    robot.place(np.zeros(27))
    servo.reset(robot.state())
    q_cmd = np.zeros(27)
    for i in range(2000):
        state = robot.state()
        if i > 250:
            q_cmd = q_cmd + np.clip(READY - q_cmd, -DT, DT)  # 1 rad/s
        wanted = servo.step(state, q_cmd, DT)
        result = gate.step(GateInputs(state.t, state, wanted, estop.step(state.t), OperatorRequest.ACTIVATE))
        assert result.state is GateState.ACTIVE, result.detail
        np.testing.assert_allclose(result.command.q, wanted.q, atol=1e-12)
        np.testing.assert_allclose(result.command.tau, wanted.tau, atol=1e-12)
        robot.advance(result.command)
    assert np.abs(READY - robot.state().q).max() < 0.002


def test_pressing_the_button_lets_raised_arms_sink_slowly(plant: Any, limits: SafetyLimits) -> None:
    robot, servo, gate, estop = plant(), Servo(ServoConfig(ramp=0.1)), Gate(limits), VirtualEstop()
    robot.place(READY)
    servo.reset(robot.state())
    fastest = 0.0
    for i in range(1250):
        state = robot.state()
        if i == 250:
            estop.press()
        wanted = servo.step(state, READY, DT)
        result = gate.step(GateInputs(state.t, state, wanted, estop.step(state.t), OperatorRequest.ACTIVATE))
        assert (result.state is GateState.ACTIVE) == (i < 250)
        robot.advance(result.command)
        fastest = max(fastest, float(np.abs(state.dq).max()))
    assert 0.5 < fastest < 4.0
    assert robot.state().q[13] > READY[13] + 0.3
