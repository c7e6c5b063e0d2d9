"""The delay of the motor drives counts time, however the time is cut into calls."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model.mjcf import robot_spec
from golem.robots.mujoco.motors import Motors
from golem.robots.sensors.profiles import MotorErrors
from golem.types import NUM_JOINTS, LowCommand

ZERO = np.zeros(NUM_JOINTS)
STEP = 0.002


def torque(value: float) -> LowCommand:
    return LowCommand(0.0, ZERO, ZERO, np.full(NUM_JOINTS, value), ZERO, ZERO)


class Drive:
    """Motors on a robot in empty space."""

    def __init__(self, delay: float) -> None:
        model = robot_spec(hands=False).compile()
        self.data = mujoco.MjData(model)
        self.motors = Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, delay)

    def advance(self, value: float, dt: float, step: float = STEP) -> list[float]:
        """Give a command and let `dt` pass; returns the torque of every physics step."""
        self.motors.give(torque(value), self.data.time)
        out = []
        for _ in range(round(dt / step)):
            self.motors.drive(self.data)
            out.append(float(self.motors.tau[0]))
            self.data.time += step
        return out


@pytest.mark.parametrize("delay", [0.0, 0.002, 0.006, 0.020])
def test_every_command_acts_after_the_delay(delay: float) -> None:
    drive, late = Drive(delay), round(delay / STEP)
    seen = [drive.advance(float(i + 1), STEP)[0] for i in range(late + 20)]
    assert seen == [1.0] * late + [float(i + 1) for i in range(20)]


def test_a_long_call_takes_the_command_up_in_its_middle() -> None:
    drive = Drive(0.006)
    drive.advance(1.0, 0.020)
    assert drive.advance(2.0, 0.020) == [1.0] * 3 + [2.0] * 7


def test_fine_steps_delay_by_the_same_time() -> None:
    drive = Drive(0.004)
    drive.advance(1.0, 0.020)
    assert drive.advance(2.0, 0.010, step=0.0005) == [1.0] * 8 + [2.0] * 12


def test_of_commands_that_fall_due_together_the_newest_acts() -> None:
    drive = Drive(0.003)
    drive.advance(1.0, 0.020)
    drive.motors.give(torque(2.0), drive.data.time)
    drive.motors.give(torque(3.0), drive.data.time)
    assert drive.advance(4.0, 0.006) == [1.0, 1.0, 4.0]


def test_without_a_command_the_motors_are_limp() -> None:
    drive = Drive(0.0)
    drive.motors.drive(drive.data)
    assert not drive.data.ctrl.any()


def test_reports_are_off_by_the_errors_that_are_asked_for_and_ideal_ones_are_not() -> None:
    model = robot_spec(hands=False).compile()
    data = mujoco.MjData(model)
    errors = MotorErrors(encoder_step=0.01, speed_noise=0.02, torque_noise=0.3, torque_gain=0.05)
    motors = Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, 0.0, None, errors, np.random.default_rng(1))
    data.qpos[7:] = np.linspace(-1.0, 1.0, NUM_JOINTS)
    motors.give(torque(20.0), 0.0)
    motors.drive(data)
    q, dq, tau = (np.array(column) for column in zip(*(motors.measure(data) for _ in range(3000)), strict=True))
    np.testing.assert_allclose(q[0], np.round(data.qpos[7:] / 0.01) * 0.01, atol=1e-12)
    assert (q == q[0]).all()
    np.testing.assert_allclose(dq.std(axis=0), 0.02, rtol=0.1)
    np.testing.assert_allclose(dq.mean(axis=0), 0.0, atol=0.002)
    np.testing.assert_allclose(tau.std(axis=0), 0.3, rtol=0.1)
    gain = tau.mean(axis=0) / 20.0 - 1.0
    assert 0.03 < gain.std() < 0.08
    assert np.abs(np.corrcoef(dq.T)[~np.eye(NUM_JOINTS, dtype=bool)]).max() < 0.08
    sound = Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, 0.0)
    sound.give(torque(20.0), 0.0)
    sound.drive(data)
    for reported, true in zip(
        sound.measure(data), (data.qpos[7:], data.qvel[6:], np.full(NUM_JOINTS, 20.0)), strict=True
    ):
        np.testing.assert_array_equal(reported, true)


def test_joints_get_their_own_friction_and_keep_the_models_where_none_is_told() -> None:
    model = robot_spec(hands=False).compile()
    before = model.dof_frictionloss[6:].copy()
    friction = np.where(np.arange(NUM_JOINTS) % 2, 1.5, np.nan)
    Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, 0.0).resist(model, friction)
    np.testing.assert_array_equal(model.dof_frictionloss[6:][1::2], 1.5)
    np.testing.assert_array_equal(model.dof_frictionloss[6:][::2], before[::2])


def test_a_torque_that_turns_crosses_the_backlash_before_the_link_feels_it() -> None:
    model = robot_spec(hands=False).compile()
    data, inertia, play = mujoco.MjData(model), float(model.dof_armature[6]), 0.004
    motors = Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, 0.0, backlash=play)
    felt, seen, end = [], [], 0.06
    for value in (1.0, -1.0):
        motors.give(torque(value), data.time)
        for _ in range(round(end / 0.0005)):
            motors.drive(data)
            felt.append(float(data.ctrl[0]))
            seen.append(float(motors.measure(data)[0][0]))
            data.time += 0.0005
    pushed = np.array(felt[len(felt) // 2 :])
    crossing = np.sqrt(2.0 * play * inertia)
    assert (pushed[: round(0.9 * crossing / 0.0005)] == 0.0).all()
    assert (pushed[round(1.1 * crossing / 0.0005) :] == -1.0).all()
    assert seen[len(seen) // 2 - 1] - seen[-1] == pytest.approx(play)  # the encoder is the motor's


def test_a_torque_below_the_friction_of_the_gears_leaves_the_rotor_in_its_play() -> None:
    model = robot_spec(hands=False).compile()
    data, motors = mujoco.MjData(model), Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, 0.0, backlash=0.004)
    motors.resist(model, np.full(NUM_JOINTS, 0.5))
    for value, moved in ((0.4, False), (0.6, True)):
        motors.give(torque(value), data.time)
        for _ in range(200):
            motors.drive(data)
            data.time += 0.0005
        assert (float(motors.measure(data)[0][0]) > 0.0) == moved


def test_the_reported_speed_of_a_rotor_in_its_play_adds_up_to_its_way() -> None:
    model = robot_spec(hands=False).compile()
    data, tick = mujoco.MjData(model), 0.002
    motors = Motors(model, np.full(NUM_JOINTS, 100.0), ZERO, 0.0, backlash=0.004)
    place = [motors.measure(data)[0]]
    way = np.zeros(NUM_JOINTS)
    for k in range(60):
        motors.give(torque(1.0 if k // 20 % 2 else -1.0), data.time)
        for _ in range(4):
            motors.drive(data)
            data.time += tick / 4
        q, dq, _ = motors.measure(data)
        way += dq * tick
        place.append(q)
    # The first tick of the drives is a step short.
    assert np.ptp(place, axis=0)[0] > 0.003
    np.testing.assert_allclose(way, place[-1] - place[0], atol=2e-4)
