"""A small world for labels: one ware on a table, and one MAGPIE hand that is led by its wrist."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from golem.robots.model.mjcf import add_hand
from golem.robots.sensors.cameras import RIGHT_HAND, rays
from golem.robots.sensors.depth import STEREO
from golem.robots.sensors.profiles import D400
from golem.robots.worlds import hall, parts
from golem.robots.worlds.kitchen import GRIP
from golem.robots.worlds.tableware import COLOURS, KINDS, add_object
from golem.types import Array

SIDE = "right"
WARE, WRIST, LEADER = "ware", f"{SIDE}_wrist_yaw_link", "leader"
WRIST_MASS, WRIST_INERTIA = 1.0, 0.003
"""What of a forearm moves with the hand [kg], [kg m^2]."""
STEP = 0.002
"""Physics step [s], as that of the twin."""
SEEN = 3
"""Every so many pixels of the palm camera have a ray."""
SIZES = (0.8, 1.2)
"""Range of the wares' size, 1 is that of the kitchen's."""


@dataclass(frozen=True, slots=True)
class WareDraw:
    """One ware on the table: its kind, size and heading [rad], and the hand's wanted approach (3,)."""

    kind: str
    size: float
    yaw: float
    approach: Array


def draw_ware(rng: np.random.Generator) -> WareDraw:
    """Return a ware of `KINDS`, to be taken from above, or forward with a lean as `take` does."""
    kind = str(rng.choice(list(KINDS)))
    size, yaw, heading = float(rng.uniform(*SIZES)), *(float(a) for a in rng.uniform(-np.pi, np.pi, 2))
    lean = 0.5 * np.pi if rng.random() < 0.65 else 0.5
    lean += float(rng.normal(0.0, 0.04))
    flat = np.cos(lean)
    approach = np.array([flat * np.cos(heading), flat * np.sin(heading), -np.sin(lean)])
    return WareDraw(kind, size, yaw, approach)


def build_world(draw: WareDraw) -> mujoco.MjModel:
    """Return the compiled world: the table's top is at z = 0, the ware stands on the origin."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_NATIVECCD
    spec.option.impratio, spec.option.cone = GRIP, mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.timestep = STEP
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    hall.add_materials(spec)
    box, top = mujoco.mjtGeom.mjGEOM_BOX, (0.6, 0.6, 0.02)
    parts.collider(spec.worldbody, box, top, (0.0, 0.0, -0.02), friction=0.7)
    parts.visual(spec.worldbody, box, top, (0.0, 0.0, -0.02), material="steel")
    add_object(spec, draw.kind, WARE, (0.0, 0.0, 0.0), draw.yaw, COLOURS[draw.kind][0], size=draw.size)
    spec.worldbody.add_body(name=LEADER, mocap=True)
    wrist = spec.worldbody.add_body(
        name=WRIST, mass=WRIST_MASS, inertia=[WRIST_INERTIA] * 3, explicitinertial=True, pos=[0.0, 0.0, 1.0],
        ipos=[0.0, 0.0, 0.0],
    )  # fmt: skip
    wrist.add_freejoint(name=WRIST)
    add_hand(spec, SIDE)
    for body in [wrist, *wrist.find_all(mujoco.mjtObj.mjOBJ_BODY)]:
        body.gravcomp = 1.0
    spec.add_equality(
        type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1=LEADER, name2=WRIST,
        data=[0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0],
    )  # fmt: skip
    return spec.compile()


def palm_cloud(
    model: mujoco.MjModel, data: mujoco.MjData, T: Array, rng: np.random.Generator
) -> tuple[Array, NDArray[np.bool_]]:
    """Return what a palm camera at `T` (4, 4) shows: (n, 3) points [m], and (n,) whether they are the ware's.

    Depth has the noise of the profile `field`.
    """
    grid = rays(RIGHT_HAND)[::SEEN, ::SEEN].reshape(-1, 3)
    ways = grid / np.linalg.norm(grid, axis=1, keepdims=True) @ T[:3, :3].T
    geoms, distances = np.zeros(len(ways), np.int32), np.zeros(len(ways))
    groups = np.array([0, 0, 1, 0, 0, 0], np.uint8)
    mujoco.mj_multiRay(
        model, data, T[:3, 3], ways.ravel(), groups, 1, -1, geoms, distances, None, len(ways), RIGHT_HAND.far
    )
    hit = geoms >= 0
    depth = distances[hit] * (ways[hit] @ T[:3, 2])
    stereo = STEREO[RIGHT_HAND.name]
    noise = depth**2 * D400.subpixel / (stereo.focal * stereo.baseline) * rng.standard_normal(len(depth))
    points = T[:3, 3] + ways[hit] * (distances[hit] * (1.0 + noise / depth))[:, None]
    return points, model.geom_bodyid[geoms[hit]] == model.body(WARE).id
