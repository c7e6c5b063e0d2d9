"""The compiled leg model against the plain kinematics, differences in time, and MuJoCo's weight and inertia."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model.leg_kernel import LegDynamics
from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.spatial import skew
from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS


@pytest.fixture(scope="module")
def model() -> mujoco.MjModel:
    return robot_spec(hands=False).compile()


@pytest.mark.parametrize("seed", range(3))
def test_soles_and_their_velocity(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, dq, h = rng.uniform(-0.4, 0.4, 12), rng.normal(size=12), 1e-6
    legs = LegDynamics()
    legs.update(q, dq)
    p, R = leg_poses(q)
    np.testing.assert_allclose(legs.soles, sole_centers(p, R), atol=1e-12)
    np.testing.assert_allclose(legs.rotations, R, atol=1e-12)
    (p0, R0), (p1, R1) = leg_poses(q - h * dq), leg_poses(q + h * dq)
    speed = (sole_centers(p1, R1) - sole_centers(p0, R0)) / (2 * h)
    np.testing.assert_allclose(legs.twists[:, :3], speed, atol=1e-6)
    turning = (R1 - R0) / (2 * h) @ R.swapaxes(-1, -2)
    np.testing.assert_allclose(skew(legs.twists[:, 3:]), turning, atol=1e-6)
    np.testing.assert_allclose((legs.jacobians @ dq.reshape(2, 6, 1))[..., 0], legs.twists)


@pytest.mark.parametrize("seed", range(3))
def test_weight_and_momentum_are_mujocos(seed: int, model: mujoco.MjModel) -> None:
    rng = np.random.default_rng(seed)
    q, dq, field = rng.uniform(-0.4, 0.4, 12), rng.normal(size=12), rng.normal(size=3)
    data = mujoco.MjData(model)
    data.qpos[[model.joint(name).qposadr[0] for name in JOINT_NAMES[LEGS]]] = q
    model.opt.gravity[:] = field
    mujoco.mj_forward(model, data)
    v = [int(model.joint(name).dofadr[0]) for name in JOINT_NAMES[LEGS]]
    legs = LegDynamics()
    legs.update(q, dq)
    np.testing.assert_allclose(legs.gravity(q, field).ravel(), data.qfrc_bias[v], atol=1e-9)
    inertia = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, inertia)
    np.testing.assert_allclose(legs.momentum.ravel(), inertia[np.ix_(v, v)] @ dq, atol=1e-9)
