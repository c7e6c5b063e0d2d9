"""The cover, ledges and lower body of the real pack, from the rectangles of its data."""

from __future__ import annotations

from collections.abc import Mapping

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.ioniq5 import Ioniq5Layout, ioniq5_data
from golem.robots.worlds.pack_part import COVER, Rectangle, Span, add_hole, add_legs, add_slab, square, without
from golem.types import Array

FRAME = (0.03, 1.20)
"""x at which the widest rectangle is cut in three, so that holes of the long edges split nothing but these [m]."""
HOLE = 0.003
"""Radius of a hole without a fastener [m]."""


def add_cover(spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: Ioniq5Layout, loose: Mapping[int, float]) -> None:
    """Add to the pack's `body` all that is no fastener; `loose`: radius of the bore or stud by loosened place [m]."""
    spots = layout.fasteners()
    bores = {slot: radius for slot, radius in loose.items() if layout.kind(slot) != "nut"}
    gone = [slot for slot in layout.empty_holes if layout.kind(slot) != "nut"]
    holes: list[tuple[str, Array, float, bool]] = [(f"{s:02d}", spots[s], bores[s], False) for s in bores]
    holes += [(f"{s:02d}", spots[s], HOLE, True) for s in gone]
    holes += [(f"free_{k}", at, HOLE, True) for k, at in enumerate(layout.holes())]
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
                _block(body, xs, ys, -COVER, -layout.thickness)
    _block(body, layout.window_x, layout.window_y, -layout.window_depth - 0.02, -layout.thickness)
    for x in np.arange(0.34, 1.0, 0.13):  # pressed beads
        size, pos = (0.03, 0.20, 0.001), (x, 0.33, 0.0005)
        parts.visual(body, mujoco.mjtGeom.mjGEOM_BOX, size, pos, material="cover_bead")
    add_legs(body, layout)


def _block(body: mujoco.MjsBody, xs: Span, ys: Span, top: float, bottom: float) -> None:
    """Add a piece of the pack below its cover."""
    size = ((xs[1] - xs[0]) / 2, (ys[1] - ys[0]) / 2, (top - bottom) / 2)
    pos = ((xs[0] + xs[1]) / 2, (ys[0] + ys[1]) / 2, (top + bottom) / 2)
    parts.collider(body, mujoco.mjtGeom.mjGEOM_BOX, size, pos)
    parts.visual(body, mujoco.mjtGeom.mjGEOM_BOX, size, pos, material="aluminium")
