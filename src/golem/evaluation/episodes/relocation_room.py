"""The room of the relocation episodes: four counters with tableware and clutter, and the eight views of a walk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from golem.robots.sensors.cameras import HEAD, T_MUJOCO_OPTICAL
from golem.robots.worlds.hall import add_materials
from golem.robots.worlds.tableware import COLOURS, add_object
from golem.types import Array

COUNTER = (0.3, 0.6, 0.45)
"""Half the depth, width and height of a counter [m]."""
AROUND = 1.7
"""Distance of the counters' middles from the middle of the room [m]."""
EYE, AHEAD = 1.55, 0.5
"""Height of the camera, and how far it goes from the middle of the room towards the counter that it looks at [m]."""
ASIDE, DOWN = 0.3, 0.6
"""Heading of a view off the counter's middle, to either side, and how far the camera looks down [rad]."""
VIEWS = 8
"""Views of one walk, two of each counter."""
CLUTTER = (0.09, 0.12, 0.09)
"""Half the sides of a box that stands around [m]."""
DAY, DUSK = 0.8, 0.15
"""Brightness of the lamp in bright and in bad light, 0 to 1."""


@dataclass(frozen=True, slots=True)
class Thing:
    """An object of the room: what it is and where it stands, in the room's frame [m]."""

    kind: str
    position: Array


@dataclass(frozen=True, slots=True)
class RelocationRoom:
    """What stands where during one walk.

    Attributes:
        things: what may be asked for.
        clutter: middles of the undersides of boxes [m].
        screens: middles of the undersides of what hides something [m].
        dusk: whether the light is bad.
    """

    things: tuple[Thing, ...]
    clutter: tuple[Array, ...] = ()
    screens: tuple[Array, ...] = ()
    dusk: bool = False


def view(k: int) -> Array:
    """Return the (4, 4) pose of the camera's optical frame in view k: before a counter, to a side of its middle."""
    counter = (k // 2) * np.pi / 2
    R = Rotation.from_euler("ZY", [counter + (ASIDE if k % 2 else -ASIDE), DOWN]).as_matrix()
    T = np.eye(4)
    T[:3, :3] = R @ np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T[:3, 3] = (AHEAD * np.cos(counter), AHEAD * np.sin(counter), EYE)
    return T


def place_camera(data: mujoco.MjData, T_optical: Array) -> None:
    """Put the camera where its optical frame is at the (4, 4) pose `T_optical`."""
    T = T_optical @ T_MUJOCO_OPTICAL
    data.mocap_pos[0] = T[:3, 3]
    data.mocap_quat[0] = Rotation.from_matrix(T[:3, :3]).as_quat(scalar_first=True)


def compile_room(room: RelocationRoom) -> tuple[mujoco.MjModel, Mapping[int, int]]:
    """Compile a room, and return with it which geom belongs to which of its things."""
    spec = mujoco.MjSpec()
    add_materials(spec)
    box, cylinder = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER
    world = spec.worldbody
    light = DUSK if room.dusk else DAY
    spec.visual.headlight.ambient = [0.5 * light] * 3
    spec.visual.headlight.diffuse = [0.5 * light] * 3
    world.add_light(pos=[0, 0, 3], dir=[0, 0, -1], diffuse=[light] * 3)
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[4, 4, 0.1], rgba=[0.5, 0.5, 0.5, 1])
    for side in range(4):
        turn = Rotation.from_euler("z", side * np.pi / 2)
        quat = turn.as_quat(scalar_first=True).tolist()
        at = turn.apply([AROUND, 0.0, COUNTER[2]]).tolist()
        world.add_geom(type=box, size=list(COUNTER), pos=at, quat=quat, rgba=[0.7, 0.65, 0.6, 1])
        wall = turn.apply([AROUND + 0.5, 0.0, 1.25]).tolist()
        world.add_geom(type=box, size=[0.05, 2.2, 1.25], pos=wall, quat=quat, rgba=[0.9, 0.9, 0.85, 1])
    for at in room.clutter:
        place = (at + (0.0, 0.0, CLUTTER[2])).tolist()
        world.add_geom(type=box, size=list(CLUTTER), pos=place, rgba=[0.4, 0.3, 0.2, 1])
    for at in room.screens:
        place = (at + (0.0, 0.0, 0.15)).tolist()
        world.add_geom(type=cylinder, size=[0.09, 0.15, 0], pos=place, rgba=[0.2, 0.4, 0.3, 1])
    names: list[Sequence[str]] = []
    for k, thing in enumerate(room.things):
        x, y, z = thing.position.tolist()
        colour = COLOURS[thing.kind][0]
        names.append(add_object(spec, thing.kind, f"thing_{k}", (x, y, z), 0.0, colour, loose=False))
    world.add_body(name="eye", mocap=True).add_camera(name=HEAD.name)
    model = spec.compile()
    return model, {model.geom(name).id: k for k, geoms in enumerate(names) for name in geoms}
