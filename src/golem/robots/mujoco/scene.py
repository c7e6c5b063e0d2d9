"""Robot and world in one MuJoCo model."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from golem.robots.model import mjcf
from golem.robots.sensors.profiles import RealismProfile
from golem.robots.sensors.streams import stream
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack import PackNames, add_pack
from golem.robots.worlds.screws import ScrewDraw, draw_screws

COARSE_STEP = 0.002
"""Physics step while nothing delicate is touched [s]."""
FINE_STEP = 0.0005
"""Physics step while a screw moves or a finger is about to touch one [s]; the bores need it."""


@dataclass(frozen=True)
class Scene:
    """A compiled world with its robot.

    Attributes:
        model: the model.
        names: what the pack added.
        layout: where the pack stands.
        draws: the loosened screws.
    """

    model: mujoco.MjModel
    names: PackNames
    layout: PackLayout
    draws: tuple[ScrewDraw, ...]


def build_scene(layout: PackLayout, profile: RealismProfile, seed: int, reach_y: float) -> Scene:
    """Compile the pack world for one seed.

    Args:
        layout: where the pack stands; x, y from the robot's pelvis, z from the floor.
        profile: ranges of the screws.
        seed: draws the screws.
        reach_y: the fasteners of the near edge with |y| up to this are loosened [m].
    """
    spec = mjcf.robot_spec(hands=True)
    slots = [s for s in layout.reachable(reach_y) if s not in layout.empty_holes]
    draws = draw_screws(stream(seed, "world/screws"), profile.screws, slots)
    names = add_pack(spec, layout, draws)
    spec.option.timestep = COARSE_STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for kind, name in (
        (mujoco.mjtSensor.mjSENS_FRAMEQUAT, "imu_quat"),
        (mujoco.mjtSensor.mjSENS_GYRO, "imu_gyro"),
        (mujoco.mjtSensor.mjSENS_ACCELEROMETER, "imu_acc"),
    ):
        if name not in {s.name for s in spec.sensors}:
            spec.add_sensor(type=kind, name=name, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="imu")
    return Scene(spec.compile(), names, layout, tuple(draws))


def settle(scene: Scene, data: mujoco.MjData, seconds: float = 0.2) -> None:
    """Let the screws come to rest in their bores with the robot held where it is."""
    model = scene.model
    qpos = data.qpos.copy()
    robot_dofs = model.jnt_dofadr[: model.njnt - len(scene.names.screws)]
    model.opt.timestep = FINE_STEP
    for _ in range(round(seconds / FINE_STEP)):
        mujoco.mj_step(model, data)
        data.qvel[: robot_dofs.max() + 1] = 0.0
        data.qpos[: len(qpos) - 7 * len(scene.names.screws)] = qpos[: len(qpos) - 7 * len(scene.names.screws)]
    data.time = 0.0


__all__ = ["COARSE_STEP", "FINE_STEP", "Scene", "build_scene", "np", "settle"]
