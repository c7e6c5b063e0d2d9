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
from golem.types import CameraInfo

COARSE_STEP = 0.002
"""Physics step while nothing delicate is touched [s]."""
FINE_STEP = 0.0005
"""Physics step while a screw moves or a finger is about to touch one [s]; the bores need it."""


ONLOOKER = CameraInfo(
    "onlooker", 640, 480, fx=700.0, fy=700.0, cx=319.5, cy=239.5, near=0.0, far=60.0, rate=15.0
)
"""A camera beside the pack, for pictures of what happened."""


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
    _add_onlooker(spec, layout)
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


def _add_onlooker(spec: mujoco.MjSpec, layout: PackLayout) -> None:
    """Add a fixed camera that watches hands and near edge from the robot's left; no module of a stack sees it."""
    eye = np.array([layout.near_edge + 0.95, 0.75, layout.top_z + 0.70])
    target = np.array([layout.near_edge + 0.02, -0.15, layout.top_z + 0.06])
    back = (eye - target) / np.linalg.norm(eye - target)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    axes = np.concatenate([right, np.cross(back, right)])
    camera = spec.worldbody.add_camera(name=ONLOOKER.name, pos=eye.tolist())
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = axes.tolist()
