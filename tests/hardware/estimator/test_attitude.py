"""Orientation, rate and planted-foot velocity against MuJoCo's kinematics, the whole robot tumbling and twisting."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from tests.hardware.estimator.sensed_feet import Feet, base_velocity

from golem.hardware.estimator.attitude import GYRO_BIAS, Attitude, track_bias
from golem.hardware.estimator.feet import FeetConfig
from golem.native import new_record
from golem.robots.model.imu_mount import sensed_base_rate
from golem.robots.model.spatial import rotation_rpy
from golem.robots.model.table import FRAMES
from golem.types import NUM_JOINTS, Array


@pytest.fixture
def tumbling(world: Callable[..., Any]) -> Callable[[int], Any]:
    """A robot adrift, with every joint and the base at a random place and speed, the feet under load in name."""
    adrift = world(floor=False)

    def make(seed: int) -> Any:
        rng = np.random.default_rng(seed)
        q = 0.4 * rng.uniform(-1.0, 1.0, NUM_JOINTS)
        adrift.place(q, rng.normal(size=3), rotation_rpy(*rng.uniform([-0.4, -0.4, -3.0], [0.4, 0.4, 3.0])))
        adrift.data.qvel[:] = rng.normal(size=adrift.model.nv)
        mujoco.mj_forward(adrift.model, adrift.data)
        return adrift

    return make


def about_z(yaw: float) -> Array:
    return rotation_rpy(0.0, 0.0, yaw)


def test_the_imu_has_the_axes_of_the_torso() -> None:
    # What `attitude` takes for granted when it undoes the waist.
    np.testing.assert_array_equal(FRAMES["imu_link"].T_parent_frame[:3, :3], np.eye(3))


@pytest.mark.parametrize("seed", range(5))
def test_rotation_and_rate_are_mujocos(seed: int, tumbling: Callable[[int], Any]) -> None:
    world = tumbling(seed)
    attitude, state, R = Attitude(), world.state(), world.T[:3, :3]
    np.testing.assert_allclose(attitude.rotation(state), R, atol=1e-9)
    np.testing.assert_allclose(sensed_base_rate(state), world.data.qvel[3:6], atol=1e-9)
    attitude.reset(state)
    heading = math.atan2(R[1, 0], R[0, 0])
    np.testing.assert_allclose(attitude.rotation(state), about_z(-heading) @ R, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_a_foot_implies_the_velocity_of_the_base_less_its_own(seed: int, tumbling: Callable[[int], Any]) -> None:
    world = tumbling(seed)
    state, R = world.state(), world.T[:3, :3]
    feet, omega = Feet(FeetConfig()), sensed_base_rate(state)
    feet.step(state, R[2], omega, 0.002)
    implied = base_velocity(R, omega, feet.points, feet.rates)
    for k, body in enumerate(world.feet):
        point = world.T[:3, 3] + R @ feet.points[k]
        jacobian = np.zeros((3, world.model.nv))
        mujoco.mj_jac(world.model, world.data, jacobian, None, point, body)
        foot = jacobian @ world.data.qvel
        np.testing.assert_allclose(implied[k], world.velocity - foot, atol=1e-9)


def test_the_bias_of_the_gyro_is_found_while_the_imu_turns_and_its_orientation_is_noisy() -> None:
    rng, bias, true = np.random.default_rng(0), new_record(GYRO_BIAS)[0], np.array([0.002, -0.003, 0.001])
    R, dt = Rotation.identity(), 0.002
    values = []
    for i in range(5000):
        rate = np.array([0.5 * np.sin(i * dt), 0.3, -0.4 * np.cos(2.0 * i * dt)])
        R = R * Rotation.from_rotvec(rate * dt)
        noisy = R * Rotation.from_rotvec(5e-4 * rng.standard_normal(3))
        # A quaternion and its negative are one orientation.
        quat = noisy.as_quat()[[3, 0, 1, 2]] * (-1.0) ** i
        track_bias(bias, quat, rate + true, dt)
        values.append(bias["value"].copy())
    np.testing.assert_allclose(values[1500:], np.tile(true, (3500, 1)), atol=1e-3)
    np.testing.assert_allclose(values[-1], true, atol=3e-4)
