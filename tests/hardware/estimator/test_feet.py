"""Forces under the feet from joint torques, against MuJoCo's contacts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.hardware.estimator.sensed_feet import Feet

from golem.hardware.estimator.attitude import Attitude
from golem.hardware.estimator.feet import FeetConfig
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.model.leg_kernel import LegDynamics
from golem.types import LEGS, NUM_JOINTS, LowState

DT = 0.002


def sense(feet: Feet, state: LowState) -> None:
    feet.step(state, Attitude().rotation(state)[2], sensed_base_rate(state), DT)


def test_the_torques_of_a_standing_robot_carry_its_weight(world: Callable[..., Any]) -> None:
    standing, feet = world(yaw=1.0), Feet(FeetConfig())
    forces, totals = [], []
    for _ in range(700):
        sense(feet, standing.advance())
        totals.append(feet.force.sum())
        forces.append(feet.force - standing.forces())
    weight = 9.81 * float(standing.model.body_subtreemass[1])
    assert np.mean(totals[300:]) == pytest.approx(weight, rel=0.02)
    assert np.abs(forces[300:]).max() < 0.02 * weight


def test_they_tell_left_from_right_while_the_weight_shifts(world: Callable[..., Any]) -> None:
    shifting, feet = world(yaw=-2.0), Feet(FeetConfig())
    estimated, true = [], []
    for i in range(700):
        shifting.exercise(i * DT)
        sense(feet, shifting.advance())
        estimated.append(feet.force)
        true.append(shifting.forces())
    error = np.array(estimated)[100:] - np.array(true)[100:]
    assert np.ptp(np.array(true)[100:, 0]) > 50.0
    assert np.sqrt((error**2).mean()) < 15.0
    assert np.all(feet.contact > 0.5)


def test_legs_that_swing_in_the_air_are_no_contact(world: Callable[..., Any]) -> None:
    hanging, feet = world(), Feet(FeetConfig())
    for i in range(1000):
        hanging.exercise(1.5 * i * DT)
        sense(feet, hanging.advance(hanging.hoist(1.1)))
        if i > 200:
            assert not feet.contact.any() and np.abs(feet.force).max() < FeetConfig().contact.touch


def test_the_pressure_is_where_mujoco_has_it(world: Callable[..., Any]) -> None:
    shifting, feet = world(yaw=1.0), Feet(FeetConfig())
    errors, places = [], []
    for i in range(600):
        shifting.exercise(i * DT)
        sense(feet, shifting.advance())
        T = shifting.T
        errors.append(T[:3, 3] + feet.points @ T[:3, :3].T - shifting.pressures())
        places.append(feet.local)
    assert np.ptp(np.array(places)[100:, :, 0]) > 0.02
    assert np.abs(np.array(errors)[100:, :, :2]).max() < 0.01


@pytest.mark.parametrize("beside", [False, True])
def test_a_foot_on_the_other_one_does_not_stand_on_the_ground(world: Callable[..., Any], beside: bool) -> None:
    """The right leg is raised and carries 600 N, the left one, which it pins to the ground in one case, hangs."""
    state = world().advance()
    q = np.zeros(NUM_JOINTS)
    for hip_pitch in (1, 7):
        q[hip_pitch], q[hip_pitch + 2], q[hip_pitch + 3] = -0.4, 0.8, -0.4
    q[8] = 0.27 if beside else 0.45  # right hip roll
    legs = LegDynamics()
    legs.update(q[LEGS], np.zeros(12))
    across, rise = (legs.soles[1] - legs.soles[0])[1:].tolist()
    assert rise > 0.02 and (abs(across) > 0.1) == beside
    wrench = np.zeros((2, 6))
    wrench[:, 2] = -100.0, 600.0
    tau = np.zeros(NUM_JOINTS)
    felt = np.einsum("kij,ki->kj", legs.jacobians, wrench)
    tau[LEGS] = (legs.gravity(q[LEGS], np.array([0.0, 0.0, -9.81])) - felt).ravel()
    feet = Feet(FeetConfig())
    feet.step(replace(state, q=q, dq=np.zeros(NUM_JOINTS), tau=tau), np.array([0.0, 0.0, 1.0]), np.zeros(3), DT)
    expected = (-100.0, 600.0) if beside else (500.0, 0.0)
    np.testing.assert_allclose(feet.force, expected, atol=5.0)
    assert feet.contact.argmax() == int(beside)
