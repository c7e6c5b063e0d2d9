"""What of the robot can touch the world: a few primitives per link, fitted to the extents of the vendor's meshes.

Who collides with whom (MuJoCo tests `contype` of one geom against `conaffinity` of the other, both ways):

| geom              | contype     | conaffinity   | touches                                  |
|-------------------|-------------|---------------|------------------------------------------|
| world and parts   | `WORLD` (1) | any with 1    | each other, the robot                    |
| body links        | `BODY` (2)  | `WORLD`       | the world; no link, no hand              |
| hands, pads       | `HAND` (4)  | `WORLD`       | the world; no link, not the other finger |

So bits let no part of the robot touch another. `self_pairs` names the shapes that may meet. They are explicit pairs of
the engine, so nothing else changes its partners. A geom that shall touch the hands alone takes contype 0 and
conaffinity `HAND`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import numpy as np
from mujoco import mjtGeom

from golem.package_data import load_data
from golem.robots.model import magpie_model
from golem.robots.model.table import SOLE
from golem.types import SIDES, Array, Side

WORLD = 1
BODY = 2
HAND = 4

Feet = Literal["spheres", "box"]
"""What stands on the floor: four small spheres at the corners of each sole, or the sole as one box. Both stand on the
same four corners; they differ on rubble and on the edge of a foot."""

FOOT_FRICTION = 0.8
"""Sliding friction of the rubber sole; chosen: the vendor's model leaves MuJoCo's default of 1."""
FOOT_SPHERE = 0.01
"""Radius of the four contact spheres at the corners of each sole [m]."""
FOOT_THICKNESS = 0.03
"""Height of the box that a foot is to the other leg, and to the floor where `Feet` says so [m]."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A collision primitive in its link's frame.

    Attributes:
        kind: sphere, capsule, cylinder or box.
        size: (3,) as in MJCF [m]: radius; radius, half length; half extents.
        pos: (3,) centre [m].
        axis: direction of a capsule's or cylinder's length (a box is never turned).
        friction: sliding.
        name: of the geom, where something refers to it.
    """

    link: str
    kind: mjtGeom
    size: Array
    pos: Array
    axis: str = "z"
    friction: float = 0.6
    name: str = ""

    @property
    def quat(self) -> tuple[float, float, float, float]:
        """Orientation, wxyz: the length, z in MuJoCo, along `axis`."""
        h = float(np.sqrt(0.5))
        return {"x": (h, 0.0, h, 0.0), "y": (h, -h, 0.0, 0.0), "z": (1.0, 0.0, 0.0, 0.0)}[self.axis]


_SPHERE, _CAPSULE = mjtGeom.mjGEOM_SPHERE, mjtGeom.mjGEOM_CAPSULE
_BOX = mjtGeom.mjGEOM_BOX
_KINDS = {"capsule": _CAPSULE, "cylinder": mjtGeom.mjGEOM_CYLINDER, "box": _BOX}
_DATA: dict[str, Any] = load_data(__package__, "contact_shapes.yaml")


def _shape(
    link: str,
    kind: mjtGeom,
    size: Sequence[float],
    pos: Sequence[float],
    axis: str = "z",
    friction: float = 0.6,
    name: str = "",
) -> Shape:
    padded = np.zeros(3)
    padded[: len(size)] = size
    return Shape(link, kind, padded, np.array(pos, dtype=float), axis, friction, name)


def _of_row(row: dict[str, Any], side: Side | None = None) -> Shape:
    """Return the shape in a row of `contact_shapes.yaml`, of one side where it is given for the left one."""
    x, y, z = row["pos"]
    prefix, pos = (f"{side}_", (x, -y if side == "right" and y else y, z)) if side else ("", (x, y, z))
    name = f"{prefix}{row['name']}" if "name" in row else ""
    return _shape(prefix + row["link"], _KINDS[row["kind"]], row["size"], pos, row.get("axis", "z"), name=name)


def body_shapes(feet: Feet = "spheres") -> list[Shape]:
    """Return the shapes of the 28 body links."""
    shapes = [_of_row(row) for row in _DATA["body"]]
    for side in SIDES:
        shapes += [_of_row(row, side) for row in _DATA["left"]]
        if feet == "box":
            shapes.append(foot_box(side))
            continue
        for x in SOLE.x:
            for y in SOLE.y:
                center = [x, y, SOLE.z + FOOT_SPHERE]
                shapes.append(_shape(f"{side}_ankle_roll_link", _SPHERE, [FOOT_SPHERE], center, friction=FOOT_FRICTION))
    return shapes


def foot_box(side: Side) -> Shape:
    """Return a foot as one box that stands on the sole's four corners."""
    (x0, x1), (y0, y1), half = SOLE.x, SOLE.y, FOOT_THICKNESS / 2
    size = [(x1 - x0) / 2, (y1 - y0) / 2, half]
    center = [(x0 + x1) / 2, (y0 + y1) / 2, SOLE.z + half]
    return _shape(f"{side}_ankle_roll_link", _BOX, size, center, friction=FOOT_FRICTION, name=f"{side}_foot")


def hand_box(side: Side) -> Shape:
    """Return the box around a hand, from the housing to the tips of its open fingers, in the hand frame."""
    link = magpie_model.hand_name(side)
    return _shape(link, _BOX, [0.019, 0.0667, 0.0975], [-0.002, 0, 0.0995], name=f"{side}_hand_box")


def self_pairs(hands: bool) -> list[tuple[str, str]]:
    """Return the names of the shapes that may meet: leg and leg, arm and arm, arm and the rest.

    Neighbours along a limb are left out, since their shapes overlap, and so is what the joints keep apart anyway. A
    robot without hands has no `hand_box`.
    """
    pairs = [(f"left_{a}", f"right_{b}") for a, b in _DATA["legs_meet"]]
    meets: dict[str, list[str]] = _DATA["arm_meets"]
    arm = [part for part in meets if hands or part != "hand_box"]
    pairs += [(f"{side}_{part}", other) for side in SIDES for part in arm for other in meets[part]]
    # An upper arm is out of the other upper arm's reach.
    pairs += [(f"left_{a}", f"right_{b}") for a, b in product(arm, arm) if (a, b) != ("upper_arm", "upper_arm")]
    return pairs


def housing_shape(link: str) -> Shape:
    """Return the hand's housing, in the hand frame."""
    return _shape(link, _BOX, [0.019, 0.0667, 0.0415], [-0.002, 0, 0.0435])


def blade_shape(link: str, finger: magpie_model.Finger) -> Shape:
    """Return a finger without its pad, in the finger frame."""
    return _shape(
        link, _BOX, [0.008, 0.006, 0.04], magpie_model.mirror(finger, np.array([0.003, -0.0147, 0.0413])).tolist()
    )
