"""Floor, lights, backdrop and materials of the workshop, and how they look under the conditions of a work place."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.package_data import load_data
from golem.robots.model.spatial import rotation_rpy
from golem.robots.worlds import parts
from golem.robots.worlds.conditions import COATS, TRAYS, Conditions, Finish
from golem.robots.worlds.layout import yaw_quat
from golem.robots.worlds.parts import BOX
from golem.types import PlanarPose

MATERIALS: dict[str, tuple[list[float], float, float, float]] = load_data(__package__, "worlds.yaml")["materials"]
"""By name: colour with opacity, specular, shininess, reflectance."""

FLOOR_FRICTION = 1.0
"""Sliding friction of the floor."""

HERE = PlanarPose(0.0, 0.0, 0.0)


def add_materials(spec: mujoco.MjSpec) -> None:
    """Add the materials that the builders in this folder name."""
    for name, (rgba, specular, shininess, reflectance) in MATERIALS.items():
        spec.add_material(name=name, rgba=list(rgba), specular=specular, shininess=shininess, reflectance=reflectance)


def add_hall(spec: mujoco.MjSpec, half: float = 6.0, *, marks: bool = True, stance: PlanarPose = HERE) -> None:
    """Add the floor (collides), walls and sky (seen only) and the lamps.

    Args:
        half: half side of the hall [m].
        marks: paint the yellow lines of the work place ahead of the robot.
        stance: middle and heading of the hall, where the robot works.
    """
    texture = mujoco.mjtTexture
    builtin = mujoco.mjtBuiltin
    spec.add_texture(
        name="sky", type=texture.mjTEXTURE_SKYBOX, builtin=builtin.mjBUILTIN_GRADIENT,
        rgb1=[0.93, 0.95, 0.98], rgb2=[0.55, 0.60, 0.68], width=128, height=128,
    )  # fmt: skip
    spec.add_texture(
        name="concrete", type=texture.mjTEXTURE_2D, builtin=builtin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_RANDOM, random=0.02, markrgb=[0.50, 0.51, 0.52],
        rgb1=[0.56, 0.57, 0.58], rgb2=[0.575, 0.585, 0.595], width=512, height=512,
    )  # fmt: skip
    floor = spec.add_material(
        name="concrete", specular=0.2, shininess=0.2, reflectance=0.0, texrepeat=[2, 2], texuniform=True
    )
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "concrete"
    add_floor(spec, half + 2, "concrete")
    hall = spec.worldbody.add_body(name="hall", pos=[stance.x, stance.y, 0.0], quat=yaw_quat(stance.yaw))
    for side in (-1, 1) if marks else ():
        parts.visual(
            hall,
            BOX,
            (0.05, 2.6, 0.002),
            (0.95, side * 1.9, 0.001),
            "warning_yellow",
            quat=(0.70710678, 0, 0, 0.70710678),
        )
    for side in (-1, 1):
        parts.visual(hall, BOX, (0.05, half, 2.0), (side * half, 0, 2.0), "wall_paint")
        parts.visual(hall, BOX, (0.06, half, 0.45), (side * (half - 0.02), 0, 0.45), "wall_band")
    for side in (-1, 1):
        parts.visual(hall, BOX, (half, 0.05, 2.0), (0, side * half, 2.0), "wall_paint")
        parts.visual(hall, BOX, (half, 0.06, 0.45), (0, side * (half - 0.02), 0.45), "wall_band")
    for y in (-4, -2, 0, 2, 4):
        parts.visual(hall, BOX, (0.08, 0.08, 2.0), (half - 0.1, y, 2.0), "aluminium")
    add_lamps(spec, stance)


def add_floor(spec: mujoco.MjSpec, half: float, material: str) -> mujoco.MjsGeom:
    """Add a square floor that collides, its half side `half` [m], and return it."""
    return spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[half, half, 0.1], material=material,
        contype=parts.WORLD_CONTACT, conaffinity=parts.WORLD_CONTACT, group=1,
        friction=[FLOOR_FRICTION, 0.01, 0.001],
    )  # fmt: skip


def add_lamps(spec: mujoco.MjSpec, stance: PlanarPose = HERE) -> None:
    """Add three lights without shadows above the work place before which the robot stands at `stance`.

    Shadows cost five times the rendering time on a CPU; set `model.light_castshadow` for figures.
    """
    T = stance.matrix()
    for x, y, z, level in ((0.2, 1.6, 3.2, 0.42), (0.2, -1.6, 3.2, 0.36), (2.6, 0.0, 3.4, 0.30)):
        aim = T[:3, :3] @ np.array([0.9 - x, -y, 1.0 - z])
        spec.worldbody.add_light(
            pos=(T @ (x, y, z, 1.0))[:3].tolist(), dir=aim.tolist(), diffuse=[level] * 3,
            specular=[level * 0.6] * 3, ambient=[0.06] * 3, castshadow=False, cutoff=70, exponent=1.0,
        )  # fmt: skip


Surface = tuple[tuple[float, float, float], float, float]
"""Colour (r, g, b), specular, shininess."""
SURFACES: dict[Finish, Surface] = {
    name: (tuple(colour), *rest) for name, (colour, *rest) in load_data(__package__, "worlds.yaml")["finishes"].items()
}
MIRRORS = ("zinc", "steel", "copper", "aluminium")
"""Materials that stereo depth loses in part: metals with a smooth surface."""
BEAD = 0.04
"""How much lighter the pressed beads are than the cover."""


def surfaces(conditions: Conditions) -> dict[str, Surface]:
    """Return the materials that differ from work place to work place, by name."""
    screws = SURFACES[conditions.finish]
    coat = COATS[conditions.cover]
    looks = {
        "zinc": screws,
        "cover_coat": (coat, *MATERIALS["cover_coat"][1:3]),
        "cover_bead": (_lighter(coat), *MATERIALS["cover_bead"][1:3]),
        "tray_teal": (TRAYS[conditions.tray], *MATERIALS["tray_teal"][1:3]),
    }
    if conditions.finish == "rust":
        looks["steel"] = (screws[0], *MATERIALS["steel"][1:3])
    return looks


def _lighter(coat: tuple[float, float, float]) -> tuple[float, float, float]:
    red, green, blue = (min(value + BEAD, 1.0) for value in coat)
    return red, green, blue


def dress(spec: mujoco.MjSpec, conditions: Conditions, stance: PlanarPose = HERE) -> None:
    """Give the materials and lamps of a work place with a pack their looks; the robot stands at `stance`."""
    for name, (colour, specular, shininess) in surfaces(conditions).items():
        material = spec.material(name)
        material.rgba, material.specular, material.shininess = [*colour, 1.0], specular, shininess
    turn, middle = rotation_rpy(0.0, 0.0, conditions.light_azimuth), stance.matrix()[:3, 3]
    for light in spec.lights:
        light.pos = (turn @ (light.pos - middle) + middle).tolist()
        light.dir = (turn @ light.dir).tolist()


def mirror_geoms(model: mujoco.MjModel, conditions: Conditions) -> np.ndarray:
    """Return (ngeom + 1,) whether each geom is mirror-like; the last entry, -1, is what has no geom."""
    names = [name for name in MIRRORS if conditions.finish != "rust" or name in ("copper", "aluminium")]
    smooth = [model.material(name).id for name in names]
    return np.append(np.isin(model.geom_matid, smooth), False)
