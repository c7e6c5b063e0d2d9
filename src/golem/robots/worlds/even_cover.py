"""The cover of the nominal pack: a rectangle whose fasteners stand at even pitch along its rim."""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.layout import HOLE_CELL, PackLayout
from golem.robots.worlds.pack_part import COVER, add_hole, add_legs, add_slab

_BOX = mujoco.mjtGeom.mjGEOM_BOX


def add_stand(body: mujoco.MjsBody, layout: PackLayout) -> None:
    """Add the pack's lower tray and the steel stand below it."""
    cx, hx, hy = layout.size_x / 2, layout.size_x / 2, layout.size_y / 2
    top = layout.window_depth + 0.025
    below = (layout.thickness - top) / 2
    mid = -top - below
    parts.collider(body, _BOX, (hx, hy, below), (cx, 0, mid))
    parts.visual(body, _BOX, (hx - 0.03, hy - 0.03, below), (cx, 0, mid), material="aluminium")
    for side in (-1, 1):
        flange = (top - COVER) / 2
        for size, pos in (
            ((0.03, hy, flange), (cx + side * (hx - 0.03), 0, -COVER - flange)),
            ((hx - 0.06, 0.03, flange), (cx, side * (hy - 0.03), -COVER - flange)),
        ):
            parts.visual(body, _BOX, size, pos, material="aluminium")
            parts.collider(body, _BOX, size, pos)
    for y in np.linspace(-hy + 0.12, hy - 0.12, 6):
        for x in (0.008, layout.size_x - 0.008):
            parts.visual(body, _BOX, (0.02, 0.03, 0.02), (x, y, -layout.thickness + 0.03), material="aluminium")
    add_legs(body, layout)


def add_rim(spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: PackLayout, holes: dict[int, float]) -> None:
    """Add the cover as boxes that leave a square open at each hole, and a holed plate in each square."""
    spots = layout.fasteners()
    wx0, wx1 = layout.window_x
    wy0, wy1 = layout.window_y
    hy = layout.size_y / 2
    gantry = 2 * 0.022
    by_side: dict[str, list[tuple[float, float]]] = {"near": [], "far": [], "left": [], "right": []}
    for slot, radius in holes.items():
        x, y, _ = spots[slot]
        side = "near" if x < gantry else "far" if x > layout.size_x - gantry else "left" if y > 0 else "right"
        by_side[side].append((x, y))
        add_hole(spec, body, f"{slot:02d}", spots[slot], radius, closed=slot in layout.empty_holes)
    # Four bands carry the fasteners, split at the holes; the field inside them surrounds the window.
    _strip(body, (0.0, gantry), (-hy, hy), by_side["near"], along=1)
    _strip(body, (layout.size_x - gantry, layout.size_x), (-hy, hy), by_side["far"], along=1)
    _strip(body, (gantry, layout.size_x - gantry), (hy - gantry, hy), by_side["left"], along=0)
    _strip(body, (gantry, layout.size_x - gantry), (-hy, -hy + gantry), by_side["right"], along=0)
    x1, y1 = layout.size_x - gantry, hy - gantry
    for xs, ys in (
        ((gantry, wx0), (-y1, y1)),
        ((wx1, x1), (-y1, y1)),
        ((wx0, wx1), (-y1, wy0)),
        ((wx0, wx1), (wy1, y1)),
    ):
        add_slab(body, xs, ys)
    for y in np.arange(-0.85, 0.9, 0.17):  # pressed beads
        for xs in ((wx1 + 0.05, x1 - 0.05), (wx0 + 0.04, wx1 - 0.04)):
            if xs[0] < wx1 and wy0 - 0.08 < y < wy1 + 0.08:
                continue
            if xs[0] < wx1 and layout.tray_z < layout.top_z + 0.01 and abs(y - layout.tray_xy[1]) < 0.2:
                continue
            parts.visual(body, _BOX, ((xs[1] - xs[0]) / 2, 0.035, 0.001), ((xs[0] + xs[1]) / 2, y, 0.0005),
                         material="cover_bead")  # fmt: skip
    parts.visual(body, _BOX, (0.045, 0.07, 0.0005), (0.085, 0.55, 0.0004), material="warning_yellow")
    parts.visual(body, _BOX, (0.030, 0.06, 0.0005), (0.085, 0.73, 0.0004), material="label_white")
    parts.visual(body, _BOX, (0.020, 0.002, 0.0006), (0.085, 0.535, 0.0006), material="dark")
    for k in range(4):
        parts.visual(body, _BOX, (0.002, 0.045 - 0.006 * (k % 2), 0.0006), (0.07 + 0.01 * k, 0.73, 0.0006),
                     material="dark")  # fmt: skip


def _strip(
    body: mujoco.MjsBody,
    xs: tuple[float, float],
    ys: tuple[float, float],
    holes: Sequence[tuple[float, float]],
    *,
    along: int,
) -> None:
    """Fill a band with slabs that leave a square of half side `HOLE_CELL` open at each of `holes`.

    `along` is the axis (0 x, 1 y) the band runs along.
    """
    ranges = [xs, ys]
    start = ranges[along][0]
    for hole in sorted(holes, key=lambda h: h[along]):
        low, high = hole[along] - HOLE_CELL, hole[along] + HOLE_CELL
        pieces = [(start, low)]
        across = ranges[1 - along]
        sides = [(across[0], hole[1 - along] - HOLE_CELL), (hole[1 - along] + HOLE_CELL, across[1])]
        for piece in pieces:
            add_slab(body, *((piece, ys) if along == 0 else (xs, piece)))
        for side in sides:
            add_slab(body, *(((low, high), side) if along == 0 else (side, (low, high))))
        start = high
    last = (start, ranges[along][1])
    add_slab(body, *((last, ys) if along == 0 else (xs, last)))
