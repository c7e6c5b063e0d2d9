"""Something that touches a hand is told at once; noise, a load that stays, and motion are not."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from tests.skills.test_force_guard import torques

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.hand_force import ContactSense, HandForce
from golem.capabilities.arms.postures import POSTURES
from golem.robots.model.table import DOF
from golem.types import NUM_JOINTS, SIDES, TICK, UPPER, Array, Imu, LowState, Side

Q, REST, LEVEL = POSTURES["ready"], np.zeros(15), np.array([0.0, 0.0, 9.81])


def moment(t: float, dq: Array, tau: Array, acc: Array = LEVEL) -> LowState:
    """Return what motors and IMU report of an upper body at `ready`, speeds and torques (15,)."""
    q, speeds, efforts = np.zeros((3, NUM_JOINTS))
    q[UPPER], speeds[UPPER], efforts[UPPER] = Q, dq, tau
    return LowState(t, q, speeds, efforts, Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), acc))


def felt(sense: ContactSense, side: Side, t: float, seconds: float, force: Array, dq: Array = REST) -> list[float]:
    """Let a hand feel a force with the noise of the motors' torques; return when something touched it."""
    rng, found = np.random.default_rng(7), list[float]()
    tau = torques(side, force)
    for k in range(round(seconds / TICK)):
        if sense.step(moment(t + k * TICK, dq, tau + rng.normal(0.0, 0.15, 15))) and sense.touching:
            found.append(t + k * TICK)
    return found


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("push", [(0.0, 0.0, 6.0), (-6.0, 0.0, 0.0), (0.0, 4.0, 4.0)])
def test_a_touch_is_found_within_30_ms_and_let_go_of(side: Side, push: tuple[float, float, float]) -> None:
    sense = ContactSense(side)
    assert felt(sense, side, 1.0, 3.0, np.zeros(3)) == []
    found = felt(sense, side, 4.0, 1.0, np.array(push))
    assert found and found[0] - 4.0 <= 0.030 and sense.touching
    assert np.linalg.norm(sense.change[:3]) == pytest.approx(np.linalg.norm(push), rel=0.4)
    felt(sense, side, 5.0, 1.0, np.zeros(3))
    assert not sense.touching


def test_an_arm_that_moves_needs_more() -> None:
    sense, fast = ContactSense("left"), np.full(15, 0.5)
    assert felt(sense, "left", 1.0, 2.0, np.zeros(3), fast) == []
    assert felt(sense, "left", 3.0, 0.5, np.array((0.0, 0.0, 5.0)), fast) == []
    assert felt(sense, "left", 3.5, 0.5, np.array((0.0, 0.0, 5.0)) + (0.0, 20.0, 0.0), fast) != []


@pytest.mark.parametrize("side", SIDES)
def test_a_blow_is_felt_before_a_motor_gives_way(side: Side) -> None:
    arm, sense, columns = UpperKinematics(), ContactSense(side), ARM_COLUMNS[side]
    felt(sense, side, 1.0, 2.0, np.zeros(3))
    arm.update(Q)
    M = pin.crba(arm.model, arm.data, Q)[columns, columns] + DOF.armature * np.eye(7)
    blow = np.concatenate([arm.placement(side).rotation.T @ (0.0, 0.0, -10.0), np.zeros(3)])
    faster = np.linalg.solve(M, arm.jacobian(side)[:, columns].T @ blow)
    tau, dq, found = torques(side, np.zeros(3)), REST.copy(), list[float]()
    for k in range(1, 16):
        dq[columns] = k * TICK * faster
        if sense.step(moment(3.0 + k * TICK, dq, tau + DOF.damping * dq)) and sense.touching:
            found.append(k * TICK)
    assert found and found[0] <= 0.030


@pytest.mark.parametrize("side", SIDES)
def test_what_a_torso_that_is_shaken_does_to_its_arms_is_no_touch(side: Side) -> None:
    arm, sense = UpperKinematics(), ContactSense(side)
    for k in range(1500):
        acc = LEVEL + (2.0 * np.sin(0.03 * k), 0.0, 1.0 * np.sin(0.07 * k))
        arm.model.gravity.linear = -acc
        tau = pin.computeGeneralizedGravity(arm.model, arm.data, Q)
        assert not sense.step(moment(1.0 + k * TICK, REST, tau, acc))
    assert np.linalg.norm(sense.change[:3]) < 0.5


def test_a_clock_that_begins_anew_is_no_touch() -> None:
    sense = ContactSense("right")
    felt(sense, "right", 9.0, 0.5, np.zeros(3))
    assert felt(sense, "right", 0.0, 0.5, np.array((0.0, 0.0, 9.0))) == []


def test_the_covariance_is_of_what_is_felt() -> None:
    feel, rng = HandForce(), np.random.default_rng(1)
    P = feel.covariance("left", Q)
    assert P.shape == (6, 6) and np.allclose(P, P.T) and (np.linalg.eigvalsh(P) > 0.0).all()
    rest = torques("left", np.zeros(3))
    spread = np.cov([feel.wrench("left", Q, rest + rng.normal(0.0, 0.5, 15)) for _ in range(600)], rowvar=False)
    # The estimate leans towards no wrench at all, so that its noise is the smaller part of its error.
    assert (np.diag(spread) <= 1.2 * np.diag(P)).all() and np.diag(spread)[:3].sum() > 0.2 * np.diag(P)[:3].sum()
