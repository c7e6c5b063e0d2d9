"""What the builders of packs share: parts that a detector knows, pieces of cover, holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.layout import HOLE_CELL, PackLayout
from golem.types import Array

COVER = 0.030
"""Height of the cover above the pack's frame [m]; bores are inside it."""
_BOX = mujoco.mjtGeom.mjGEOM_BOX
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER

Span = tuple[float, float]
Rectangle = tuple[float, float, float, float]
"""x0, x1, y0, y1 [m]."""


@dataclass(frozen=True, slots=True)
class PackPart:
    """One thing a detector can be asked for.

    Attributes:
        label: `screw`, `screw_hole`, `nut`, `bus_bar` or `tray`.
        body: the body it belongs to.
        geoms: the visible geoms that make it up; empty for a hole, which is an absence.
        position: (3,) centre of its visible top in the world at the start [m]; a nut's top is under its stud's tip.
        size: (3,) extent of its visible part along the axes of pack or tray [m].
    """

    label: str
    body: str
    geoms: tuple[str, ...]
    position: Array
    size: Array


def square(hole: Sequence[float] | Array) -> Rectangle:
    """Return what a hole at x, y takes out of the cover."""
    x, y = hole[:2]
    return x - HOLE_CELL, x + HOLE_CELL, y - HOLE_CELL, y + HOLE_CELL


def without(rectangle: Rectangle, cuts: Sequence[Rectangle]) -> list[tuple[Span, Span]]:
    """Return the x and y spans of pieces that together are `rectangle` without `cuts`."""
    x0, x1, y0, y1 = rectangle
    mine = [c for c in cuts if c[0] < x1 and c[1] > x0 and c[2] < y1 and c[3] > y0]
    ends = sorted({y0, y1, *(float(np.clip(y, y0, y1)) for c in mine for y in c[2:])})
    pieces: list[tuple[Span, Span]] = []
    for low, high in zip(ends[:-1], ends[1:], strict=True):
        start = x0
        for a, b, _, _ in sorted(c for c in mine if c[2] <= low and c[3] >= high):
            if a > start:
                pieces.append(((start, a), (low, high)))
            start = max(start, b)
        if start < x1:
            pieces.append(((start, x1), (low, high)))
    return pieces


def add_slab(
    body: mujoco.MjsBody, xs: Span, ys: Span, top: float = 0.0, thick: float = COVER, material: str = "cover_coat"
) -> None:
    """Add one piece of a pack, seen and colliding, from its extent in x and y, the height of its top, and below."""
    size = ((xs[1] - xs[0]) / 2, (ys[1] - ys[0]) / 2, thick / 2)
    pos = ((xs[0] + xs[1]) / 2, (ys[0] + ys[1]) / 2, top - thick / 2)
    parts.collider(body, _BOX, size, pos)
    parts.visual(body, _BOX, size, pos, material=material)


def add_hole(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, at: Array, radius: float, *, closed: bool) -> None:
    """Fill the square of `HOLE_CELL` around `at` (3,) with a holed plate; where `closed`, nothing falls in."""
    x, y, z = at
    plate = parts.add_mesh(spec, f"hole_plate_{name}", *parts.holed_plate(HOLE_CELL, radius, 0.022))
    parts.visual_mesh(body, plate, (x, y, z), material="cover_coat", name=f"hole_{name}")
    if closed:  # a dropped screw is wider than the hole: it rolls over it
        parts.collider(body, _BOX, (HOLE_CELL, HOLE_CELL, COVER / 2), (x, y, z - COVER / 2 - 0.0005))
    parts.visual(body, _CYLINDER, (radius, 0.0005), (x, y, z - 0.0215), material="hole_dark")


def add_legs(body: mujoco.MjsBody, layout: PackLayout) -> None:
    """Add the steel stand below a pack, and the connectors on its left end; only the legs collide."""
    cx, hx, hy = layout.size_x / 2, layout.size_x / 2, layout.size_y / 2
    for x, length in ((0.12, hy + 0.03), (layout.size_x - 0.12, hy + 0.03)):
        parts.visual(body, _BOX, (0.03, length, 0.03), (x, 0, -layout.thickness - 0.03), material="stand_blue")
    for y in (-0.7, 0.0, 0.7):
        parts.visual(body, _BOX, (hx - 0.06, 0.025, 0.025), (cx, y, -layout.thickness - 0.085),
                     material="stand_blue")  # fmt: skip
    leg = (layout.top_z - layout.thickness - 0.06) / 2
    for x in (0.12, layout.size_x - 0.12):
        parts.visual(body, _BOX, (0.02, 0.7, 0.02), (x, 0, 0.16 - layout.top_z), material="stand_blue")
        for y in (-0.7, 0.7):
            size, pos = (0.03, 0.03, leg - 0.04), (x, y, -layout.thickness - 0.06 - leg + 0.04)
            parts.visual(body, _BOX, size, pos, material="stand_blue")
            parts.collider(body, _BOX, size, pos)
            parts.visual(body, _CYLINDER, (0.05, 0.02), (x, y, 0.05 - layout.top_z), material="rubber",
                         quat=(0.70710678, 0.70710678, 0, 0))  # fmt: skip
    # High-voltage connectors and the service plug on the left end.
    for x in (0.45, 0.62, 0.80):
        parts.visual(body, _BOX, (0.05, 0.03, 0.035), (x, hy + 0.02, -0.075), material="hv_orange")
        parts.visual(body, _CYLINDER, (0.022, 0.03), (x, hy + 0.07, -0.075), material="hv_orange",
                     quat=(0.70710678, 0.70710678, 0, 0))  # fmt: skip
