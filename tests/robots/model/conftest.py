"""Compiled models and small readers shared by the tests of the robot model."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pytest

from golem.robots.model import mjcf
from golem.robots.model.table import JOINT_NAMES, load_limits
from golem.types import Array


class Reader:
    """Joint-space quantities of a MuJoCo model in motor order, without armature, base level at the origin."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.qpos = np.array([model.joint(name).qposadr[0] for name in JOINT_NAMES])
        self.dofs = np.array([model.joint(name).dofadr[0] for name in JOINT_NAMES])

    def update(self, q: Array) -> None:
        self.data.qpos[:] = self.model.qpos0
        self.data.qpos[:3] = 0.0
        self.data.qpos[self.qpos] = q
        mujoco.mj_forward(self.model, self.data)

    def mass_matrix(self) -> Array:
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        full -= np.diag(self.model.dof_armature)
        return full[np.ix_(self.dofs, self.dofs)]

    def gravity(self) -> Array:
        return self.data.qfrc_bias[self.dofs]

    def anchors(self) -> Array:
        """(27, 3) positions of the joints."""
        return np.array([self.data.joint(name).xanchor for name in JOINT_NAMES])


@pytest.fixture(scope="session")
def reader() -> type[Reader]:
    return Reader


@pytest.fixture(scope="session")
def robot() -> mujoco.MjModel:
    return mjcf.robot_spec().compile()


@pytest.fixture(scope="session")
def bare_robot() -> mujoco.MjModel:
    return mjcf.robot_spec(hands=False).compile()


@pytest.fixture
def postures() -> Callable[[int], Array]:
    """Return `postures(n)`: (n, 27) joint angles drawn uniformly from the joint ranges."""

    def draw(count: int) -> Array:
        limits = load_limits()
        return np.random.default_rng(7).uniform(limits.lower, limits.upper, (count, 27))

    return draw
