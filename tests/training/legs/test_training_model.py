"""The trainer's physics: ground that holds, and the same robot as the twin's."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.scene import build_scene
from golem.robots.sensors.profiles import load_profile
from golem.robots.worlds.layout import PackLayout
from golem.training.legs.batch_world import BatchWorld, WorldConfig
from golem.training.legs.training_model import STANCE, STAND_HEIGHT, build_model
from golem.types import NUM_JOINTS

ABOVE = 0.002
"""Height of the soles above the floor [m]."""
STEPS = 60
UPPER = np.zeros((4, 15))
PLAIN = WorldConfig(leg_offset=0.0, arm_offset=0.0, slope=0.0, roughness=0.0, delay=0)


def put(qpos: np.ndarray, height: float) -> None:
    """Stand a robot, or (n, nq) robots, with its soles `height` above the floor."""
    qpos[..., :2], qpos[..., 2], qpos[..., 3:7] = 0.0, STAND_HEIGHT + height, [1.0, 0.0, 0.0, 0.0]
    qpos[..., 7 : 7 + NUM_JOINTS] = np.concatenate([STANCE, UPPER[0]])


@pytest.mark.parametrize("lowered", [0.01, 0.02, 0.04])
def test_a_sphere_of_a_foot_that_is_lowered_touches_the_ground_at_once(lowered: float) -> None:
    model, ids = build_model()
    data = mujoco.MjData(model)
    put(data.qpos, ABOVE)
    model.geom_pos[ids.soles, 2] -= lowered
    mujoco.mj_forward(model, data)
    assert data.ncon == len(ids.soles) and (data.sensordata[ids.touch] > 100.0).all()


def test_ground_that_is_drawn_under_a_foot_holds_it_at_once() -> None:
    world = BatchWorld(4, PLAIN, np.random.default_rng(0), 1)
    world.reset(np.arange(4), UPPER, 0.0)
    world._corners[:, world.ids.soles, 2] -= np.array([[-1.0], [0.01], [0.02], [0.04]])
    put(world._qpos, ABOVE)
    world._qvel[:] = 0.0
    world._batch.forward(np.arange(4))
    force = world._sensors[:, world.ids.touch]
    assert not force[0].any() and (force[1:] > 100.0).all()


def test_the_batch_moves_as_mujoco_does_with_what_was_drawn_for_each_robot() -> None:
    world, rng = BatchWorld(4, WorldConfig(), np.random.default_rng(0), 2), np.random.default_rng(1)
    world.reset(np.arange(4), UPPER, 1.0)
    world._rough[:] = 1.0
    world.shim(np.ones((4, 2), dtype=bool))
    batch = world._batch
    models = [batch.get_model(k) for k in range(4)]
    plain = [mujoco.MjData(model) for model in models]
    for k, data in enumerate(plain):
        data.qpos[:], data.qvel[:] = world._qpos[k], world._qvel[k]
    contacts = 0
    for _ in range(STEPS):
        world._ctrl[:, :NUM_JOINTS] = np.concatenate([STANCE, UPPER[0]]) + rng.normal(0.0, 0.1, (4, NUM_JOINTS))
        for k, data in enumerate(plain):
            data.ctrl[:] = world._ctrl[k]
            mujoco.mj_step(models[k], data)
            contacts += data.ncon
        batch.step(nstep=1, stage=int(mujoco.mjtStage.mjSTAGE_VEL))
        for k, data in enumerate(plain):
            np.testing.assert_allclose(world._qpos[k], data.qpos, rtol=0, atol=1e-9)
            np.testing.assert_allclose(world._qvel[k], data.qvel, rtol=0, atol=1e-9)
    assert contacts > STEPS * 4


def like_the_trainers(twin: mujoco.MjModel, own: mujoco.MjModel) -> None:
    """Give the twin what the trainer changes on purpose: solver, servos, joints without dry friction, lumped hands."""
    for name in ("timestep", "iterations", "ls_iterations", "impratio", "disableflags"):
        setattr(twin.opt, name, getattr(own.opt, name))
    twin.dof_frictionloss[:] = 0.0
    twin.eq_active0[:] = 0
    twin.actuator_ctrllimited[:NUM_JOINTS] = False
    for name in ("gainprm", "biasprm", "biastype", "forcelimited", "forcerange"):
        getattr(twin, f"actuator_{name}")[:NUM_JOINTS] = getattr(own, f"actuator_{name}")[:NUM_JOINTS]
    for body in range(twin.nbody):
        name = twin.body(body).name
        if name.endswith(("_crank", "_finger")):
            twin.body_mass[body], twin.body_inertia[body] = 0.0, 0.0
            for dof in range(twin.body_dofadr[body], twin.body_dofadr[body] + twin.body_dofnum[body]):
                twin.dof_armature[dof] = 1.0
        elif name.endswith("_hand"):
            for what in ("mass", "inertia", "ipos", "iquat"):
                getattr(twin, f"body_{what}")[body] = getattr(own, f"body_{what}")[own.body(name).id]
    mujoco.mj_setConst(twin, mujoco.MjData(twin))
    twin.stat.meaninertia = own.stat.meaninertia  # the solver's tolerance is in units of it


def test_the_robot_moves_as_the_twins_does_under_the_trainers_settings() -> None:
    """Compares joints, base and their velocities: a landing from 2 mm, then 0.6 s of random targets on flat ground."""
    drawn = replace(PLAIN, friction=(0.8, 0.8), torso_mass=(0.0, 0.0), strength=(1.0, 1.0))
    world, rng = BatchWorld(4, drawn, np.random.default_rng(0), 1), np.random.default_rng(1)
    scene = build_scene(MujocoConfig("ground", "open", friction=0.8), PackLayout(), load_profile("ideal"), 0)
    twin, own = scene.model, world._model
    like_the_trainers(twin, own)
    world.reset(np.arange(4), UPPER, 0.0)
    put(world._qpos, ABOVE)
    world._qvel[:] = rng.normal(0.0, 0.1, world._qvel.shape)
    joints = [twin.joint(own.joint(j).name) for j in range(own.njnt)]
    q = np.concatenate([np.arange(j.qposadr[0], j.qposadr[0] + len(j.qpos0)) for j in joints])
    v = np.concatenate([np.arange(j.dofadr[0], j.dofadr[0] + len(j.damping)) for j in joints])
    datas = [mujoco.MjData(twin) for _ in range(4)]
    for k, data in enumerate(datas):
        data.qpos[q], data.qvel[v] = world._qpos[k], world._qvel[k]
    landed = 0
    for _ in range(STEPS):
        world._ctrl[:] = np.concatenate([STANCE, UPPER[0]]) + rng.normal(0.0, 0.1, (4, NUM_JOINTS))
        world._batch.step(nstep=1, stage=int(mujoco.mjtStage.mjSTAGE_VEL))
        for k, data in enumerate(datas):
            data.ctrl[:NUM_JOINTS] = world._ctrl[k]
            mujoco.mj_step(twin, data)
            landed += data.ncon
            np.testing.assert_allclose(data.qpos[q], world._qpos[k], rtol=0, atol=1e-9)
            np.testing.assert_allclose(data.qvel[v], world._qvel[k], rtol=0, atol=1e-9)
    assert landed > STEPS * 4
