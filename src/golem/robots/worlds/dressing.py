"""How a work place looks under its conditions: finishes, coats and the turn of the lamps."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.package_data import load_data
from golem.robots.model.spatial import rotation_rpy
from golem.robots.worlds.conditions import COATS, TRAYS, Conditions, Finish
from golem.robots.worlds.hall import HERE, MATERIALS
from golem.types import PlanarPose

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
