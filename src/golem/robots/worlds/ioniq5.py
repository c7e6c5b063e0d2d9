"""A real pack: 84 fasteners on two levels, nuts among screws, a dented end, nine holes, and the cover around them."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import mujoco
import numpy as np

from golem.package_data import load_data
from golem.robots.worlds.layout import KINDS, Kind, PackLayout, TrayPlace
from golem.robots.worlds.pack_part import COVER, Rectangle, add_hole, add_legs, add_slab, square, without
from golem.types import Array, PlanarPose

RIM = 0.857
"""Height of the rim over the floor on which the robot stands, at the condition `height` 0 [m]."""
_TRAYS: list[tuple[str, Kind, tuple[float, float, float]]] = load_data(__package__, "worlds.yaml")["ioniq5_trays"]
"""Name, kind, and x, y, yaw in the pack frame of trays: both kinds are within reach all round [m, rad]."""
FRAME = (0.03, 1.20)
"""x at which the widest rectangle is cut in three, so that holes of the long edges split nothing but these [m]."""


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
    kinds: tuple[Kind, ...] = tuple(known for kind, _ in rows for known in KINDS if kind == known)
    fasteners, holes, cover = (np.array([row for k, row in rows if k in w]) for w in (KINDS, ("hole",), ("cover",)))
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

        Where the first is on the robot's left, those along the long edges, nearer to its middle, are mirrored.
        """
        pack = PlanarPose(self.near_edge, self.center_y, self.yaw)
        first = pack.to(PlanarPose(*self.tray_xy, self.tray_yaw))
        side = -1.0 if first.y > 0.0 else 1.0
        homes = [PlanarPose(x, y * (side if abs(y) < 0.7 else 1.0), yaw) for _, _, (x, y, yaw) in _TRAYS]
        moved = homes[0].to(first)
        places = [pack @ home @ moved for home in homes]
        return tuple(
            TrayPlace(name, kind, at.x, at.y, self.tray_z, at.yaw)
            for (name, kind, _), at in zip(_TRAYS, places, strict=True)
        )

    def kind(self, slot: int) -> Kind:
        return ioniq5_data().kinds[slot]

    def fasteners(self) -> Array:
        """Return the (84, 3) places in the pack frame, in the order of the file."""
        return ioniq5_data().fasteners.copy()

    def holes(self) -> Array:
        return ioniq5_data().holes.copy()

    def reachable(self, reach_y: float = 0.35) -> list[int]:
        """Return the places along the near edge, its ledge among them, with |y| <= `reach_y` [m], right to left."""
        spots = self.fasteners()
        return [int(i) for i in np.argsort(spots[:, 1]) if spots[i, 0] < 0.05 and abs(spots[i, 1]) <= reach_y]

    def around(self, reach_y: float) -> list[int]:
        """Return all places."""
        return list(range(len(self.fasteners())))


def add_cover(spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: Ioniq5Layout, loose: Mapping[int, float]) -> None:
    """Add to the pack's `body` all that is no fastener; `loose`: radius of the bore or stud by loosened place [m]."""
    spots = layout.fasteners()
    places = {**loose, **dict.fromkeys(layout.empty_holes, 0.003)}
    bored = [(s, radius) for s, radius in places.items() if layout.kind(s) != "nut"]
    holes: list[tuple[str, Array, float, bool]] = [(f"{s:02d}", spots[s], r, s not in loose) for s, r in bored]
    holes += [(f"free_{k}", at, 0.003, True) for k, at in enumerate(layout.holes())]
    for name, at, radius, closed in holes:
        add_hole(spec, body, name, at, radius, closed=closed)
    window: Rectangle = (*layout.window_x, *layout.window_y)
    for x0, x1, y0, y1, top in ioniq5_data().cover:
        marks = [x0, *(x for x in FRAME if x0 < x < x1 and x1 - x0 > 1.2), x1]
        cuts = [square(at) for _, at, _, _ in holes if at[2] == top]
        for part in zip(marks[:-1], marks[1:], strict=True):
            for xs, ys in without((*part, y0, y1), [*cuts, window]):
                add_slab(body, xs, ys, top)
        if top == 0.0:
            for xs, ys in without((x0, x1, y0, y1), [window]):
                add_slab(body, xs, ys, -COVER, layout.thickness - COVER, "aluminium")
    floor = layout.window_depth + 0.02
    add_slab(body, layout.window_x, layout.window_y, -floor, layout.thickness - floor, "aluminium")
    add_legs(body, layout)
