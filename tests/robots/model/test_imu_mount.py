"""The rate of base_link against the physics engine's, with the waist turning."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.model.imu_mount import turn_to_base
from golem.robots.model.mjcf import robot_spec
from golem.robots.model.table import JOINT_NAMES


def test_base_rate_undoes_the_waist_joint() -> None:
    model = robot_spec(hands=False).compile()
    data = mujoco.MjData(model)
    torso, pelvis = (model.body(name).id for name in ("torso_link", "pelvis"))
    waist = JOINT_NAMES.index("torso_joint")
    rng = np.random.default_rng(0)
    for _ in range(20):
        data.qpos[3:7] = rng.normal(size=4)
        data.qpos[3:7] /= np.linalg.norm(data.qpos[3:7])
        data.qpos[7:] = rng.uniform(-1, 1, model.nq - 7)
        data.qvel[:] = rng.normal(size=model.nv)
        mujoco.mj_forward(model, data)
        velocity = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, torso, velocity, 1)
        gyro, rate = velocity[:3].copy(), np.empty(3)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, pelvis, velocity, 1)
        joint = model.joint(JOINT_NAMES[waist])
        turn_to_base(gyro, data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]], rate)
        np.testing.assert_allclose(rate, velocity[:3], atol=1e-12)
