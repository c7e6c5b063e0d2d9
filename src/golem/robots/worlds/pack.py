"""An Ioniq 5 battery pack on a stand, its cover opened over the bus bars, with loosened screws along the near edge.

Dimensions: 1.2 x 2.0 m and about 400 kg (the paper), 68 cover fasteners (RAPID, arXiv 2603.18520), modules in four
rows. Head size, thread and bore are not published; `screws.ScrewRanges` gives what is assumed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from golem.errors import ConfigError
from golem.robots.worlds import hall, pack_part, parts, screws
from golem.robots.worlds.ioniq5 import Ioniq5Layout, add_cover
from golem.robots.worlds.layout import PackLayout, TrayPlace, yaw_quat
from golem.robots.worlds.pack_part import COVER, PackPart, Span, add_hole, add_legs, add_slab, square, without
from golem.robots.worlds.parts import BOX, CYLINDER
from golem.robots.worlds.screws import ScrewDraw
from golem.types import Array, PlanarPose

WALL, DEEP = 0.003, 0.010
"""Thickness of a tray's walls and floor, and how far the floor's collider goes on below it [m]: a nut of 2 g that is
let go 10 cm above falls by as much as the floor in a tick, and would come through."""


def add_tray(spec: mujoco.MjSpec, layout: PackLayout, place: TrayPlace) -> None:
    """Add the tray as a static body at its underside's centre, on a pedestal when it stands off the cover."""
    sx, sy, sz = layout.tray_size
    paint = "stand_blue" if place.kind == "nut" else "tray_teal"
    body = spec.worldbody.add_body(name=place.name, pos=[place.x, place.y, place.z], quat=yaw_quat(place.yaw))
    hx, hy, hz = sx / 2, sy / 2, sz / 2
    walls = [((hx, hy, WALL / 2), (0.0, 0.0, WALL / 2))]
    walls += [((WALL / 2, hy, hz), (side * (hx - WALL / 2), 0.0, hz)) for side in (1, -1)]
    walls += [((hx, WALL / 2, hz), (0.0, side * (hy - WALL / 2), hz)) for side in (1, -1)]
    for k, (size, pos) in enumerate(walls):
        (a, b, c), (x, y, z), deep = size, pos, 0.0 if k else 0.5 * DEEP
        parts.collider(body, BOX, (a, b, c + deep), (x, y, z - deep), friction=0.8)
        parts.visual(body, BOX, size, pos, paint, name=f"{place.name}_part_{k}")
    rim = 0.006
    rims = [((rim / 2, hy + rim / 2, 0.0015), (side * hx, 0.0, sz)) for side in (1, -1)]
    rims += [((hx + rim / 2, rim / 2, 0.0015), (0.0, side * hy, sz)) for side in (1, -1)]
    for k, (size, pos) in enumerate(rims):
        parts.visual(body, BOX, size, pos, paint, name=f"{place.name}_rim_{k}")
    x, y, _, _ = np.linalg.inv(layout.pose()) @ (place.x, place.y, place.z, 1.0)
    over_cover = 0.0 < x < layout.size_x and abs(y) < layout.size_y / 2
    foot = layout.top_z if over_cover else 0.0
    if place.z - foot > 0.005:
        post = (place.z - foot) / 2
        radius = 0.03
        parts.visual(body, CYLINDER, (radius, post), (0, 0, -post), "stand_blue")
        parts.collider(body, CYLINDER, (radius, post), (0, 0, -post))
        if not over_cover:
            parts.visual(body, BOX, (hx, hy, 0.01), (0, 0, -2 * post + 0.01), "stand_blue")


STUD_PITCH = 0.09
FASTENER_HEAD = (0.0105, 0.006)
"""Across flats and height of the heads that are still tight [m]."""
TIGHT = ((0.009, 0.005, 0.0), (0.0125, 0.007, 0.0016))
"""The same and what lies below, least and most [m]: up to an M6 washer, 1.6 mm (ISO 7089); heads are assumed."""


@dataclass(frozen=True, slots=True)
class PackNames:
    """What was added.

    Attributes:
        screws: names of the loosened screws' bodies (free joint of the same name), in the order of the draws.
        mouths: (n, 3) centres of their bores' mouths in the world [m].
        parts: everything the detector knows, loosened screws included.
    """

    screws: tuple[str, ...]
    mouths: Array
    parts: tuple[PackPart, ...]


def set_contact_options(spec: mujoco.MjSpec) -> None:
    """Set the solver options the bores need: elliptic cone, impratio 10, and sleeping of undisturbed screws."""
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0
    spec.option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP


def add_pack(
    spec: mujoco.MjSpec,
    layout: PackLayout,
    draws: Sequence[ScrewDraw],
    *,
    sleep: bool = True,
    stance: PlanarPose = hall.HERE,
    workshop: bool = True,
    tight: np.random.Generator | None = None,
) -> PackNames:
    """Add pack, stand, tray and loosened screws to `spec`, which may already hold the robot.

    Args:
        draws: the loosened screws; the other fasteners are fixed.
        sleep: let undisturbed screws sleep.
        stance: where the robot should stand before the pack: lamps and workshop are placed by it.
        workshop: add the workshop around it; a world without has materials and floor already.
        tight: draws head and washer of each tight screw from `TIGHT`; None has all alike, without washers.

    Raises:
        ConfigError: two screws share a place, a place does not exist or is an empty hole.
    """
    spots = layout.fasteners()
    slots = [draw.slot for draw in draws]
    bad = [s for s in slots if not 0 <= s < len(spots) or s in layout.empty_holes]
    if bad or len(set(slots)) != len(slots):
        raise ConfigError(
            f"Screws can stand in each of the places 0 to {len(spots) - 1} once, except the empty "
            f"{', '.join(map(str, layout.empty_holes))}; asked for {', '.join(map(str, slots))}."
        )
    set_contact_options(spec)
    if workshop:
        hall.add_materials(spec)
        hall.add_hall(spec, stance=stance)
    else:
        hall.add_lamps(spec, stance)
    T = layout.pose()
    body = spec.worldbody.add_body(name="pack", pos=T[:3, 3].tolist(), quat=yaw_quat(layout.yaw))
    loose = {draw.slot: draw.bore_radius for draw in draws}
    if isinstance(layout, Ioniq5Layout):
        add_cover(spec, body, layout, loose)
    else:
        _add_stand(body, layout)
        _add_rim(spec, body, layout, loose | dict.fromkeys(layout.empty_holes, 0.003))
    pack_part.add_meshes(spec)
    found = _add_window(body, layout)
    found += _add_fasteners(spec, body, layout, set(slots), tight)
    for draw in draws:
        (pack_part.add_stud if draw.kind == "nut" else screws.add_bore)(body, draw, spots[draw.slot])
    for draw in draws:
        name, spot = draw.name, spots[draw.slot]
        (pack_part.add_nut if draw.kind == "nut" else screws.add_screw)(spec, draw, spot, T, sleep=sleep)
        reach = draw.protrusion + draw.head_height
        looks = (f"{name}_flange",) if draw.kind == "nut" else (f"{name}_flange", f"{name}_thread")
        looks += (f"{name}_hex",) if draw.hexagonal or draw.kind == "nut" else ()
        size = np.array([draw.head_diameter, draw.head_diameter, reach])
        label = "nut" if draw.kind == "nut" else "screw"
        found.append(PackPart(label, name, looks, spot + reach * draw.axis(), size))
    found = [replace(part, position=T[:3, :3] @ part.position + T[:3, 3]) for part in found]
    for place in layout.trays():
        add_tray(spec, layout, place)
        geoms = tuple(f"{place.name}_part_{k}" for k in range(5)) + tuple(f"{place.name}_rim_{k}" for k in range(4))
        found.append(PackPart("tray", place.name, geoms, place.pose()[:3, 3], np.array(layout.tray_size)))
    mouths = np.array([spots[s] for s in slots]).reshape(-1, 3)
    return PackNames(tuple(d.name for d in draws), mouths @ T[:3, :3].T + T[:3, 3], tuple(found))


def _add_stand(body: mujoco.MjsBody, layout: PackLayout) -> None:
    """Add the pack's lower tray and the steel stand below it."""
    cx, hx, hy = layout.size_x / 2, layout.size_x / 2, layout.size_y / 2
    top = layout.window_depth + 0.025
    below = (layout.thickness - top) / 2
    mid = -top - below
    parts.collider(body, BOX, (hx, hy, below), (cx, 0, mid))
    parts.visual(body, BOX, (hx - 0.03, hy - 0.03, below), (cx, 0, mid), "aluminium")
    for side in (-1, 1):
        flange = (top - COVER) / 2
        for size, pos in (
            ((0.03, hy, flange), (cx + side * (hx - 0.03), 0, -COVER - flange)),
            ((hx - 0.06, 0.03, flange), (cx, side * (hy - 0.03), -COVER - flange)),
        ):
            parts.visual(body, BOX, size, pos, "aluminium")
            parts.collider(body, BOX, size, pos)
    for y in np.linspace(-hy + 0.12, hy - 0.12, 6):
        for x in (0.008, layout.size_x - 0.008):
            parts.visual(body, BOX, (0.02, 0.03, 0.02), (x, y, -layout.thickness + 0.03), "aluminium")
    add_legs(body, layout)


def _add_rim(spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: PackLayout, holes: dict[int, float]) -> None:
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
            if abs(y) > hy - 0.1 or (xs[0] < wx1 and wy0 - 0.08 < y < wy1 + 0.08):
                continue
            if xs[0] < wx1 and layout.tray_z < layout.top_z + 0.01 and abs(y - layout.tray_xy[1]) < 0.2:
                continue
            parts.visual(body, BOX, ((xs[1] - xs[0]) / 2, 0.035, 0.001), ((xs[0] + xs[1]) / 2, y, 0.0005), "cover_bead")
    parts.visual(body, BOX, (0.045, 0.07, 0.0005), (0.085, 0.55, 0.0004), "warning_yellow")
    parts.visual(body, BOX, (0.030, 0.06, 0.0005), (0.085, 0.73, 0.0004), "label_white")
    parts.visual(body, BOX, (0.020, 0.002, 0.0006), (0.085, 0.535, 0.0006), "dark")
    for k in range(4):
        parts.visual(body, BOX, (0.002, 0.045 - 0.006 * (k % 2), 0.0006), (0.07 + 0.01 * k, 0.73, 0.0006), "dark")


def _strip(body: mujoco.MjsBody, xs: Span, ys: Span, holes: Sequence[tuple[float, float]], *, along: int) -> None:
    """Fill a band along axis `along` (0 x, 1 y) with slabs that leave a `square` open at each of `holes`."""
    if along == 1:
        pieces = without((*xs, *ys), [square(hole) for hole in holes])
    else:
        pieces = [(x, y) for y, x in without((*ys, *xs), [square(hole[::-1]) for hole in holes])]
    for piece in pieces:
        add_slab(body, *piece)


def _add_window(body: mujoco.MjsBody, layout: PackLayout) -> list[PackPart]:
    """Add modules, bus bars and nuts in the opened section; places are in the pack frame."""
    (x0, x1), (y0, y1), depth = layout.window_x, layout.window_y, layout.window_depth
    floor = -depth
    cx, cy, hx, hy = (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2
    parts.collider(body, BOX, (hx, hy, 0.01), (cx, cy, floor - 0.01))
    parts.visual(body, BOX, (hx, hy, 0.01), (cx, cy, floor - 0.012), "dark")
    lip = 0.004
    for y in (y0 - lip / 2, y1 + lip / 2):
        parts.visual(body, BOX, (hx + lip, lip / 2, 0.001), (cx, y, 0.0005), "steel")
    for x in (x0 - lip / 2, x1 + lip / 2):
        parts.visual(body, BOX, (lip / 2, hy, 0.001), (x, cy, 0.0005), "steel")
    columns = int((y1 - y0 - 0.02) // (2 * STUD_PITCH))
    pitch = 2 * STUD_PITCH
    start = cy - pitch * columns / 2
    found: list[PackPart] = []
    for row in range(2):
        mx = x0 + (0.27 + 0.46 * row) * (x1 - x0)
        for col in range(columns):
            my = start + pitch * (col + 0.5)
            parts.visual(body, BOX, (0.095, pitch / 2 - 0.006, 0.009), (mx, my, floor + 0.001), "module_black")
            for end in (-1, 1):
                parts.visual(
                    body, BOX, (0.012, pitch / 2 - 0.012, 0.004), (mx + end * 0.078, my, floor + 0.012), "module_cap"
                )
            for rib in (-0.03, 0.0, 0.03):
                parts.visual(body, BOX, (0.004, pitch / 2 - 0.02, 0.001), (mx + rib, my, floor + 0.0105), "module_cap")
    top = floor + 0.014
    for row in range(2):
        for col in range(columns - 1):
            by = start + pitch * (col + 1)
            for k, offset in enumerate((-0.05, 0.045)):
                if (row + 2 * col + k) % 4 == 3:
                    continue
                bx = x0 + (0.27 + 0.46 * row) * (x1 - x0) + offset
                name = f"bus_bar_{row}{col}{k}"
                found += _add_bus_bar(body, (bx, by, top), name, along=1)
    bx, by = cx, start + pitch * (columns - 0.5)
    found += _add_bus_bar(body, (bx, by, top), "bus_bar_link", along=0)
    return found


def _add_bus_bar(body: mujoco.MjsBody, pos: tuple[float, float, float], name: str, *, along: int) -> list[PackPart]:
    """Add one bar with an orange sleeve, a nut on a stud at each end, and their colliders."""
    half = STUD_PITCH / 2 + 0.016
    x, y, z = pos
    thick = 0.0015
    bar = (0.011, half, thick) if along else (half, 0.011, thick)
    sleeve = (0.013, half - 0.034, 0.0045) if along else (half - 0.034, 0.013, 0.0045)
    parts.visual(body, BOX, bar, (x, y, z), "copper", name=f"{name}_bar")
    parts.visual(body, BOX, sleeve, (x, y, z + 0.001), "hv_orange", name=f"{name}_sleeve")
    parts.collider(body, BOX, bar, (x, y, z))
    extent = np.array([2 * bar[0], 2 * bar[1], 2 * sleeve[2]])
    centre = np.array([x, y, z + 0.0055])
    found = [PackPart("bus_bar", "pack", (f"{name}_bar", f"{name}_sleeve"), centre, extent)]
    for end in (-1, 1):
        nx, ny = (x, y + end * STUD_PITCH / 2) if along else (x + end * STUD_PITCH / 2, y)
        label = f"nut_{name[8:]}_{'b' if end > 0 else 'a'}"
        found.append(pack_part.add_tight(body, (nx, ny, z + thick), label))
    return found


def _add_fasteners(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: PackLayout, loose: set[int], tight: np.random.Generator | None
) -> list[PackPart]:
    """Add the tight fasteners and list the empty holes; where they are is in the pack frame."""
    (flats, height), low = FASTENER_HEAD, 0.0
    head = parts.add_mesh(spec, "fastener_hex", *parts.hexagon(flats, height))
    flange = parts.add_mesh(
        spec, "fastener_flange", *parts.lathe([(0.0072, 0.0), (0.0072, 0.001), (0.0058, 0.0018)], sides=24)
    )
    found: list[PackPart] = []
    found += [PackPart("screw_hole", "pack", (), at, np.array([0.006, 0.006, 0.0])) for at in layout.holes()]
    for slot, at in enumerate(layout.fasteners()):
        x, y, z = at
        if slot in loose:
            continue
        if layout.kind(slot) == "nut":
            if slot in layout.empty_holes:
                pack_part.add_bare(body, at)
            else:
                found.append(pack_part.add_tight(body, at, f"nut_{slot:02d}"))
        elif slot in layout.empty_holes:
            found.append(PackPart("screw_hole", "pack", (), at, np.array([0.006, 0.006, 0.0])))
        else:
            names = (f"fastener_{slot:02d}_flange", f"fastener_{slot:02d}_hex")
            if tight is not None:
                flats, height, low = tight.uniform(*TIGHT)
                head = parts.add_mesh(spec, names[1], *parts.hexagon(flats, height))
                parts.visual(body, CYLINDER, (0.0072, low / 2), (x, y, z + low / 2), "steel")
            top = low + height
            parts.visual_mesh(body, flange, (x, y, z + low), material="zinc", name=names[0])
            parts.visual_mesh(body, head, (x, y, z + low), material="zinc", name=names[1])
            parts.collider(body, CYLINDER, (0.006 * flats / FASTENER_HEAD[0], top / 2), (x, y, z + top / 2))
            size = np.array([0.0144, 0.0144, top])
            found.append(PackPart("screw", "pack", names, at + [0, 0, top], size))
    return found
