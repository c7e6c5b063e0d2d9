"""The compiled rays hit what MuJoCo's single rays hit, at the same distance."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.mujoco.config import MujocoConfig, World
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.lidar_sensor import matrix, seen_shapes, turn, turned, visible
from golem.robots.mujoco.ray_kernel import cast
from golem.runtime.lockstep import start_posture

GROUPS = np.array([1, 1, 0, 0, 0, 0], dtype=np.uint8)


@pytest.mark.parametrize("world", ["plant", "rubble"])
def test_rays_hit_what_mujoco_says(world: World) -> None:
    plant = world == "plant"
    config = MujocoConfig(support="ground", world=world, stance=(2.0, 0.1, 0.1), obstacles=4 * plant, people=2 * plant)
    twin = MujocoRobot("ideal", 0, start_posture(True), config)
    model, data = visible(twin.scene.model), mujoco.MjData(twin.scene.model)
    data.qpos[:] = twin.data.qpos
    mujoco.mj_kinematics(model, data)
    origin = data.body("torso_link").xpos + (0.05, 0.0, 0.66)
    rng = np.random.default_rng(0)
    rays = rng.standard_normal((3000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    azimuth = np.arctan2(rays[:, 1], rays[:, 0])
    # One wedge after the other, as the sensor does.
    expected, found = np.empty(0), np.empty(0)
    parts = [rays[np.abs(azimuth - middle) <= 0.1] for middle in np.arange(-3.0, 3.1, 0.2)]
    geom = np.zeros(1, np.int32)
    for part in parts:
        expected = np.append(
            expected, [mujoco.mj_ray(model, data, origin, ray, GROUPS, True, -1, geom) for ray in part]
        )
    shapes, others = seen_shapes(model)
    assert not others and len(shapes) > 100
    kinds = model.geom_type.astype(np.int64)
    for middle, part in zip(np.arange(-3.0, 3.1, 0.2), parts, strict=True):
        out = np.empty(len(part))
        cast(origin, np.eye(3), np.array([middle, 0.101]), np.ascontiguousarray(part), shapes, kinds,
             model.geom_size, model.geom_rbound, data.geom_xpos, data.geom_xmat, out)  # fmt: skip
        found = np.append(found, out)
    assert (expected > 0.0).mean() > 0.5
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_turns_add_up() -> None:
    rng = np.random.default_rng(1)
    q = np.array([1.0, 0.0, 0.0, 0.0])
    for rotvec in rng.uniform(-1.5, 1.5, (50, 3)):
        new = turned(q, rotvec)
        np.testing.assert_allclose(turn(q, new), rotvec, atol=1e-12)
        R = matrix(new)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        q = new
    np.testing.assert_allclose(turn(q, -q), 0.0, atol=1e-9)
