"""The hoist: it carries the robot where it hangs, and what swings dies away."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.robots.model.mjcf import robot_spec
from golem.robots.mujoco.external_forces import Hoist, HoistConfig
from golem.types import Array

NO_SWAY = np.zeros(2)


class Hanging:
    """The robot in the hoist, its joints stiff, nothing around it."""

    def __init__(self, config: HoistConfig | None = None) -> None:
        self.config = config or HoistConfig()
        spec = robot_spec(hands=True)
        self.model = spec.compile()
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        self.model.opt.timestep = 0.002
        self.model.geom_contype[:] = 0
        hinges = [i for i in range(self.model.njnt) if self.model.joint(i).type == mujoco.mjtJoint.mjJNT_HINGE]
        for i in hinges:
            self.model.jnt_stiffness[i] = 5000.0
            self.model.dof_damping[self.model.jnt_dofadr[i]] = 50.0
        self.data = mujoco.MjData(self.model)
        self.hoist = Hoist(self.model, self.config)
        self.base = int(self.model.joint("base").qposadr[0])
        self.data.qpos[self.base : self.base + 3] = (0.0, 0.0, self.config.height)
        mujoco.mj_forward(self.model, self.data)

    @property
    def position(self) -> Array:
        return self.data.qpos[self.base : self.base + 3].copy()

    @property
    def tilt(self) -> float:
        """Angle of the pelvis against the upright [rad]."""
        return float(np.arccos(np.clip(self.data.body("pelvis").xmat[8], -1.0, 1.0)))

    def run(self, seconds: float, sway: Array = NO_SWAY, push: Array | None = None) -> Array:
        """Let time pass and return the pelvis' positions, (n, 3); `push` (3,) [N] acts on the pelvis."""
        path: list[Array] = []
        for _ in range(round(seconds / self.model.opt.timestep)):
            self.hoist.apply(self.data, sway)
            if push is not None:
                self.data.xfrc_applied[self.model.body("pelvis").id, :3] += push
            mujoco.mj_step(self.model, self.data)
            path.append(self.position)
        return np.array(path)


def test_the_robot_rests_where_it_was_hung() -> None:
    hanging = Hanging()
    hanging.run(4.0)
    assert np.linalg.norm(hanging.position - (0.0, 0.0, 1.10)) < 0.002
    assert hanging.tilt < np.radians(0.5)
    assert np.abs(hanging.data.qvel[:6]).max() < 1e-3


def test_another_height() -> None:
    hanging = Hanging(HoistConfig(height=1.3))
    hanging.run(4.0)
    assert abs(hanging.position[2] - 1.3) < 0.002


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_push_moves_it_as_far_as_its_stiffness_says(axis: int) -> None:
    hanging = Hanging()
    rest = hanging.run(4.0)[-1]
    push = np.zeros(3)
    push[axis] = 40.0
    moved = hanging.run(4.0, push=push)[-1] - rest
    assert moved[axis] == pytest.approx(40.0 / hanging.config.stiffness[axis], rel=0.15)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_what_swings_dies_away(axis: int) -> None:
    hanging = Hanging()
    rest = hanging.run(4.0)[-1]
    hanging.data.qpos[hanging.base + axis] += 0.02
    path = hanging.run(4.0)[:, axis] - rest[axis]
    # Damping ratio 0.7: the first overshoot is 5 % of the displacement, the second nothing.
    assert -0.004 < path.min() < 0.0
    assert np.abs(path[len(path) // 2 :]).max() < 2e-4


def test_a_tilt_is_undone() -> None:
    hanging = Hanging()
    hanging.run(2.0)
    hanging.data.qpos[hanging.base + 3 : hanging.base + 7] = (np.cos(0.05), np.sin(0.05), 0.0, 0.0)
    hanging.run(0.002)
    assert hanging.tilt > 0.09
    hanging.run(4.0)
    assert hanging.tilt < np.radians(0.5)


def test_a_quaternion_and_its_negative_are_one_attitude() -> None:
    hanging = Hanging()
    hanging.data.qpos[hanging.base + 3 : hanging.base + 7] = (-np.cos(0.05), -np.sin(0.05), 0.0, 0.0)
    hanging.run(4.0)
    assert hanging.tilt < np.radians(0.5)


def test_the_robot_follows_the_hook() -> None:
    hanging = Hanging()
    rest = hanging.run(4.0)[-1]
    sway = np.array([0.01, -0.02])
    moved = hanging.run(4.0, sway=sway)[-1] - rest
    np.testing.assert_allclose(moved, [0.01, -0.02, 0.0], atol=3e-4)


def test_the_sway_given_is_not_kept() -> None:
    hanging = Hanging()
    rest = hanging.run(4.0)[-1]
    hanging.run(0.1, sway=np.array([0.01, 0.0]))
    np.testing.assert_allclose(hanging.run(4.0)[-1], rest, atol=1e-4)
