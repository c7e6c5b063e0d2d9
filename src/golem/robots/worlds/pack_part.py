"""What the builders of packs share: parts that a detector knows, pieces of cover, holes.

Flange nuts on studs: tight ones that belong to the pack, and loosened ones that lift off.

A loosened nut is a ring of six boxes around its stud. It stands on a collar that is narrower than the nut: the passive
stand-in for the thread that it still hangs in, as a bore's bottom is for a screw.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from golem.package_data import load_data
from golem.robots.worlds import parts
from golem.robots.worlds.layout import HOLE_CELL, PackLayout, yaw_quat
from golem.robots.worlds.parts import ALONG_Y, BOX, CAPSULE, CYLINDER
from golem.robots.worlds.screws import SOLREF, ScrewDraw, loosened
from golem.types import Array

COVER = 0.030
"""Height of the cover above the pack's frame [m]; bores are inside it."""

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
    parts.solid(body, BOX, size, pos, material)


def add_hole(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, at: Array, radius: float, *, closed: bool) -> None:
    """Fill the square of `HOLE_CELL` around `at` (3,) with a holed plate; where `closed`, nothing falls in."""
    x, y, z = at
    plate = parts.add_mesh(spec, f"hole_plate_{name}", *parts.holed_plate(HOLE_CELL, radius, 0.022))
    parts.visual_mesh(body, plate, (x, y, z), material="cover_coat", name=f"hole_{name}")
    if closed:  # a dropped screw is wider than the hole: it rolls over it
        parts.collider(body, BOX, (HOLE_CELL, HOLE_CELL, COVER / 2), (x, y, z - COVER / 2 - 0.0005))
    parts.visual(body, CYLINDER, (radius, 0.0005), (x, y, z - 0.0215), "hole_dark")


def add_legs(body: mujoco.MjsBody, layout: PackLayout) -> None:
    """Add the steel stand below a pack, and the connectors on its left end; only the legs collide."""
    cx, hx, hy = layout.size_x / 2, layout.size_x / 2, layout.size_y / 2
    for x, length in ((0.12, hy + 0.03), (layout.size_x - 0.12, hy + 0.03)):
        parts.visual(body, BOX, (0.03, length, 0.03), (x, 0, -layout.thickness - 0.03), "stand_blue")
    for y in (-0.7, 0.0, 0.7):
        parts.visual(body, BOX, (hx - 0.06, 0.025, 0.025), (cx, y, -layout.thickness - 0.085), "stand_blue")
    leg = (layout.top_z - layout.thickness - 0.06) / 2
    for x in (0.12, layout.size_x - 0.12):
        parts.visual(body, BOX, (0.02, 0.7, 0.02), (x, 0, 0.16 - layout.top_z), "stand_blue")
        for y in (-0.7, 0.7):
            size, pos = (0.03, 0.03, leg - 0.04), (x, y, -layout.thickness - 0.06 - leg + 0.04)
            parts.visual(body, BOX, size, pos, "stand_blue")
            parts.collider(body, BOX, size, pos)
            parts.visual(body, CYLINDER, (0.05, 0.02), (x, y, 0.05 - layout.top_z), "rubber", quat=ALONG_Y)
    # High-voltage connectors and the service plug on the left end.
    for x in (0.45, 0.62, 0.80):
        parts.visual(body, BOX, (0.05, 0.03, 0.035), (x, hy + 0.02, -0.075), "hv_orange")
        parts.visual(body, CYLINDER, (0.022, 0.03), (x, hy + 0.07, -0.075), "hv_orange", quat=ALONG_Y)


FLATS, COLLAR = 0.8, 0.0042
"""Width across flats per diameter of the flange; radius of what a loosened nut stands on [m]."""


def add_meshes(spec: mujoco.MjSpec) -> None:
    """Add the meshes of tight nuts and their washers."""
    parts.add_mesh(spec, "nut", *parts.hexagon(0.010, 0.006))
    parts.add_mesh(spec, "washer", *parts.lathe([(0.0085, 0.0), (0.0085, 0.0012)], sides=24))


def add_bare(body: mujoco.MjsBody, seat: Sequence[float]) -> None:
    """Add a stud at `seat` (3,) whose nut is gone."""
    size, pos = (0.003, 0.006), (seat[0], seat[1], seat[2] + 0.006)
    parts.visual(body, CYLINDER, size, pos, "steel")
    parts.collider(body, CYLINDER, size, pos)


def add_tight(body: mujoco.MjsBody, seat: Sequence[float], label: str) -> PackPart:
    """Add a tight nut on its stud at `seat` (3,) in the frame of the pack's `body`; its part is in that frame."""
    x, y, base = seat
    parts.visual_mesh(body, "washer", (x, y, base), material="steel", name=f"{label}_washer")
    parts.visual_mesh(body, "nut", (x, y, base + 0.0012), material="zinc", name=f"{label}_hex")
    parts.visual(body, CYLINDER, (0.003, 0.006), (x, y, base + 0.006), "steel", name=f"{label}_stud")
    parts.collider(body, CYLINDER, (0.0055, 0.006), (x, y, base + 0.006))
    geoms = (f"{label}_washer", f"{label}_hex", f"{label}_stud")
    return PackPart("nut", "pack", geoms, np.array([x, y, base + 0.0072]), np.array([0.017, 0.017, 0.012]))


def add_stud(parent: mujoco.MjsBody, draw: ScrewDraw, seat: Sequence[float]) -> None:
    """Add the stud of a loosened nut as a static body at `seat` (3,) in the parent frame, and its collar."""
    body = parent.add_body(name=f"stud_{draw.slot:02d}", pos=list(seat), quat=draw.quat())
    for radius, length in ((draw.shank_diameter / 2, draw.shank_length), (COLLAR, draw.protrusion)):
        size, pos = (radius, length / 2), (0.0, 0.0, length / 2)
        parts.collider(body, CYLINDER, size, pos, friction=draw.friction, solref=SOLREF)
    size, pos = (draw.shank_diameter / 2, draw.shank_length / 2), (0.0, 0.0, draw.shank_length / 2)
    parts.visual(body, CYLINDER, size, pos, "steel")
    parts.visual(body, CYLINDER, (0.0085, 0.0006), (0.0, 0.0, 0.0006), "steel")


def add_nut(
    spec: mujoco.MjSpec, draw: ScrewDraw, spot: Sequence[float], T_world_pack: Array, *, sleep: bool = True
) -> str:
    """Add the free body of a loosened nut around its stud; arguments and result as of `screws.add_screw`."""
    name, body = draw.name, loosened(spec, draw, spot, T_world_pack, sleep=sleep)
    inner, outer, height = draw.bore_radius, FLATS * draw.head_diameter / 2, draw.head_height
    for k in range(6):
        a, mid = (k + 0.5) * np.pi / 3, (inner + outer) / 2
        parts.collider(
            body, BOX, ((outer - inner) / 2, outer * np.tan(np.pi / 6), height / 2),
            (mid * np.cos(a), mid * np.sin(a), height / 2), quat=(np.cos(a / 2), 0.0, 0.0, np.sin(a / 2)),
            friction=draw.friction, solref=SOLREF, mass=draw.mass / 6,
        )  # fmt: skip
    edge, flange = 0.0006, draw.head_diameter / 2
    corner = 2 * outer / np.sqrt(3.0)
    for part, sides, profile in (
        ("hex", 6, [(corner, 0.0), (corner, height - edge), (corner - 1.5 * edge, height), (inner, height)]),
        ("flange", 24, [(flange, 0.0), (flange, 0.0012), (flange * 0.82, 0.002), (inner, 0.002)]),
    ):
        ring = [(inner, 0.0), *profile, (inner, 0.0)]
        mesh = parts.add_mesh(spec, f"{name}_{part}", *parts.lathe(ring, sides))
        parts.visual_mesh(body, mesh, material="zinc", name=f"{name}_{part}")
    return name


CLEAR = 0.05
"""Distance that things keep from fasteners of the near edge, from trays and from the opened section [m]."""
ATTEMPTS = 30
_SHAPES = {"box": BOX, "cylinder": CYLINDER, "capsule": CAPSULE}
_THINGS: list[list[dict[str, Any]]] = list(load_data(__package__, "worlds.yaml")["clutter"].values())
"""What may lie there, shape by shape."""


def add_clutter(spec: mujoco.MjSpec, layout: PackLayout, count: int, rng: np.random.Generator) -> int:
    """Put up to `count` things on the cover, fixed where they lie, and return how many found a place.

    Args:
        spec: the world, which has the body `pack`.
        rng: the same state puts the same things at the same places.
    """
    pack = spec.body("pack")
    T_pack = np.linalg.inv(layout.pose())
    trays = np.array([(T_pack @ tray.pose())[:2, 3] for tray in layout.trays()])
    tray_radius = 0.5 * float(np.hypot(*layout.tray_size[:2]))
    placed: list[tuple[float, float]] = []
    for k in range(count):
        for _ in range(ATTEMPTS):
            x, y = float(rng.uniform(0.08, 0.75)), float(rng.uniform(-0.55, 0.55))
            if _free(layout, x, y, trays, tray_radius, placed):
                break
        else:
            continue
        placed.append((x, y))
        body = pack.add_body(name=f"clutter_{k}", pos=[x, y, 0.0], quat=yaw_quat(float(rng.uniform(-np.pi, np.pi))))
        for row in _THINGS[int(rng.integers(len(_THINGS)))]:
            shape, size, pos = _SHAPES[row["shape"]], row["size"], row["pos"]
            if "material" in row:
                parts.visual(body, shape, size, pos, row["material"], quat=row.get("quat", (1.0, 0.0, 0.0, 0.0)))
            else:
                parts.collider(body, shape, size, pos)
    return len(placed)


def _free(
    layout: PackLayout, x: float, y: float, trays: np.ndarray, radius: float, placed: list[tuple[float, float]]
) -> bool:
    window = (
        layout.window_x[0] - CLEAR < x < layout.window_x[1] + CLEAR
        and layout.window_y[0] - CLEAR < y < layout.window_y[1] + CLEAR
    )
    beside_trays = (np.hypot(x - trays[:, 0], y - trays[:, 1]) > radius + CLEAR).all()
    return not window and bool(beside_trays) and all(np.hypot(x - a, y - b) > 2 * CLEAR for a, b in placed)
