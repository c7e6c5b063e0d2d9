"""Where the fasteners of a real pack are: 84 on two levels, nuts among screws, a dented end, and nine holes."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from golem.robots.worlds.layout import KINDS, Kind, PackLayout, TrayPlace
from golem.types import Array, PlanarPose

RIM = 0.857
"""Height of the rim over the floor on which the robot stands, at the condition `height` 0 [m]."""
LONG_EDGES = (0.145, 1.092)
"""x of the trays along the long edges, in the pack frame [m]."""
_TRAYS: tuple[tuple[str, Kind, tuple[float, float, float]], ...] = (
    ("tray", "screw", (LONG_EDGES[0], -0.28, 0.0)),
    ("tray_nuts", "nut", (LONG_EDGES[0], -0.55, 0.0)),
    ("tray_left", "screw", (0.45, 0.81, np.pi / 2)),
    ("tray_left_nuts", "nut", (0.72, 0.81, np.pi / 2)),
    ("tray_far", "screw", (LONG_EDGES[1], 0.28, np.pi)),
    ("tray_far_nuts", "nut", (LONG_EDGES[1], 0.55, np.pi)),
    ("tray_right", "screw", (0.72, -0.90, -np.pi / 2)),
    ("tray_right_nuts", "nut", (0.45, -0.90, -np.pi / 2)),
)
"""Name, kind, and x, y, yaw in the pack frame of trays on the right of who works at each edge [m, rad]."""


class Ioniq5Data(NamedTuple):
    """What `ioniq5.csv` has: kinds and (84, 3) places of the fasteners, (9, 3) holes, (n, 5) rectangles [m]."""

    kinds: tuple[Kind, ...]
    fasteners: Array
    holes: Array
    cover: Array


@cache
def ioniq5_data() -> Ioniq5Data:
    """Return the rows of the file; it says what they mean."""
    text = files(__package__ or "").joinpath("ioniq5.csv").read_text(encoding="utf-8")
    rows = [(row[0], [float(x) for x in row[1:]]) for row in csv.reader(text.splitlines()) if row[0][0] != "#"]
    kinds = tuple(known for kind, _ in rows for known in KINDS if kind == known)
    fasteners, holes, cover = (
        np.array([row for kind, row in rows if kind in wanted]) for wanted in (KINDS, ("hole",), ("cover",))
    )
    return Ioniq5Data(kinds, fasteners, holes, cover)


@dataclass(frozen=True, slots=True)
class Ioniq5Layout(PackLayout):
    """A `PackLayout` whose fasteners, holes and outline are those of `ioniq5.csv`; trays stand along every edge."""

    top_z: float = RIM
    size_x: float = 1.237
    size_y: float = 2.14
    window_x: tuple[float, float] = (0.28, 0.77)
    window_y: tuple[float, float] = (-0.41, -0.02)
    empty_holes: tuple[int, ...] = ()
    tray_xy: tuple[float, float] = (0.555, -0.2334)
    tray_z: float = RIM + 0.013
    tray_size: tuple[float, float, float] = (0.14, 0.22, 0.045)

    def trays(self) -> tuple[TrayPlace, ...]:
        """Return all trays: where the first is moved or turned from its place, each is on its own.

        Where the first is on the robot's left, those along the long edges are mirrored.
        """
        pack = PlanarPose(self.near_edge, self.center_y, self.yaw)
        first = pack.to(PlanarPose(*self.tray_xy, self.tray_yaw))
        side = -1.0 if first.y > 0.0 else 1.0
        homes = [PlanarPose(x, y * (side if x in LONG_EDGES else 1.0), yaw) for _, _, (x, y, yaw) in _TRAYS]
        moved = homes[0].to(first)
        places = [pack @ home @ moved for home in homes]
        return tuple(
            TrayPlace(name, kind, at.x, at.y, self.tray_z, at.yaw)
            for (name, kind, _), at in zip(_TRAYS, places, strict=True)
        )

    def kind(self, slot: int) -> Kind:
        """Return what is in a place."""
        return ioniq5_data().kinds[slot]

    def fasteners(self) -> Array:
        """Return the (84, 3) places in the pack frame, in the order of the file."""
        return ioniq5_data().fasteners.copy()

    def holes(self) -> Array:
        """Return the (9, 3) holes in the pack frame."""
        return ioniq5_data().holes.copy()

    def reachable(self, reach_y: float = 0.35) -> list[int]:
        """Return the places along the near edge, its ledge among them, with |y| <= `reach_y` [m], right to left."""
        spots = self.fasteners()
        return [int(i) for i in np.argsort(spots[:, 1]) if spots[i, 0] < 0.05 and abs(spots[i, 1]) <= reach_y]

    def around(self, reach_y: float) -> list[int]:
        """Return all places."""
        return list(range(len(self.fasteners())))
