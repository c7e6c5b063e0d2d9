"""The linearised torques are MuJoCo's, and their derivatives those of differences."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from golem.evaluation.identification import regressor as r
from golem.evaluation.identification.identify_command import body_spec
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.table import JOINT_NAMES
from golem.types import Array


def drawn(seed: int) -> tuple[Array, list[Array]]:
    rng = np.random.default_rng(seed)
    x = r.NOMINAL + 0.5 * r.PRIOR * rng.uniform(-1.0, 1.0, len(r.PRIOR))
    x[r.PAYLOAD] = rng.uniform(0.2, 2.0, 2)
    q, dq, ddq = rng.uniform(-0.4, 0.4, 27), rng.normal(size=27), rng.normal(size=27)
    gyro, turn, spin, acc, jerk = rng.normal(size=(5, 3))
    return x, [q, dq, ddq, gyro, turn, spin, acc + [0.0, 0.0, 9.81], jerk]


def test_torques_are_those_of_mujoco() -> None:
    x, sample = drawn(0)
    q, dq, ddq = sample[:3]
    x[r.ZERO], x[r.BIAS], x[r.LAG] = 0.0, 0.0, 0.0
    model = body_spec(x, loaded=True).compile()
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    at, to = (np.array([getattr(model.joint(n), k)[0] for n in JOINT_NAMES]) for k in ("qposadr", "dofadr"))
    data.qpos[at], data.qvel[to], data.qacc[to] = q, dq, ddq
    mujoco.mj_inverse(model, data)
    own = x[r.ARMATURE] * ddq + x[r.DAMPING] * dq
    # The pelvis rests: the torso turns with the waist alone.
    gyro, turn = np.array([0.0, 0.0, dq[TORSO]]), np.array([0.0, 0.0, ddq[TORSO]])
    acc = [0.0, 0.0, 9.81] + np.cross(turn, r.IMU_AT) + np.cross(gyro, np.cross(gyro, r.IMU_AT))
    tree = r.HangingTree()
    tree.load(x)
    torque, _ = tree.linearise(x, q, dq, ddq, gyro, turn, np.zeros(3), acc, np.zeros(3))
    np.testing.assert_allclose(torque, data.qfrc_inverse[to] - own, atol=1e-6)


@pytest.mark.parametrize("seed", [1, 2])
def test_derivatives_are_those_of_differences(seed: int) -> None:
    x, sample = drawn(seed)
    x[r.LAG] = 0.0
    tree = r.HangingTree()

    def torque(x: Array) -> Array:
        tree.load(x)
        return tree.linearise(x, *sample)[0]

    tree.load(x)
    common, step = tree.linearise(x, *sample)[1], 1e-6
    for column, i in enumerate(np.r_[0:30, r.ZERO, r.BIAS]):
        up, down = x.copy(), x.copy()
        up[i] += step
        down[i] -= step
        slope = (torque(up) - torque(down)) / (2.0 * step)
        if i >= r.BIAS.start:
            slope[TORSO] = 0.0  # of what is below the waist, too: left out
        np.testing.assert_allclose(common[:, column], slope, atol=1e-5, err_msg=r.NAMES[i])
