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
from golem.robots.worlds import even_cover, hall, ioniq5_cover, nuts, opened_section, parts, screws, tray
from golem.robots.worlds.ioniq5 import Ioniq5Layout
from golem.robots.worlds.layout import PackLayout, yaw_quat
from golem.robots.worlds.pack_part import PackPart
from golem.robots.worlds.screws import ScrewDraw
from golem.types import Array, PlanarPose

FASTENER_HEAD = (0.0105, 0.006)
"""Across flats and height of the heads that are still tight [m]."""

_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER


@dataclass(frozen=True, slots=True)
class PackNames:
    """What was added.

    Attributes:
        screws: names of the loosened screws' bodies (free joint of the same name), in the order of the draws.
        mouths: (n, 3) centres of their bores' mouths in the world [m].
        tray: name of the tray's body.
        parts: everything the detector knows, loosened screws included.
    """

    screws: tuple[str, ...]
    mouths: Array
    tray: str
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
) -> PackNames:
    """Add pack, stand, tray and loosened screws to `spec`, which may already hold the robot.

    Args:
        spec: the world to extend.
        layout: where things stand.
        draws: the loosened screws; the other fasteners are fixed.
        sleep: let undisturbed screws sleep.
        stance: where the robot should stand before the pack: lamps and workshop are placed by it.
        workshop: add the workshop around it; a world without has materials and floor already.

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
        ioniq5_cover.add_cover(spec, body, layout, loose)
    else:
        even_cover.add_stand(body, layout)
        even_cover.add_rim(spec, body, layout, loose | dict.fromkeys(layout.empty_holes, 0.003))
    meshes = nuts.add_meshes(spec)
    found = opened_section.add_window(body, layout, meshes)
    found += _add_fasteners(spec, body, layout, set(slots), meshes)
    for draw in draws:
        (nuts.add_stud if draw.kind == "nut" else screws.add_bore)(body, draw, spots[draw.slot])
    for draw in draws:
        name, spot = draw.name, spots[draw.slot]
        (nuts.add_nut if draw.kind == "nut" else screws.add_screw)(spec, draw, spot, T, sleep=sleep)
        reach = draw.protrusion + draw.head_height
        looks = (f"{name}_flange",) if draw.kind == "nut" else (f"{name}_flange", f"{name}_thread")
        looks += (f"{name}_hex",) if draw.hexagonal or draw.kind == "nut" else ()
        size = np.array([draw.head_diameter, draw.head_diameter, reach])
        label = "nut" if draw.kind == "nut" else "screw"
        found.append(PackPart(label, name, looks, spot + reach * draw.axis(), size))
    found = [replace(part, position=T[:3, :3] @ part.position + T[:3, 3]) for part in found]
    for place in layout.trays():
        tray.add_tray(spec, layout, place)
        geoms = tuple(f"{place.name}_part_{k}" for k in range(5)) + tuple(f"{place.name}_rim_{k}" for k in range(4))
        found.append(PackPart("tray", place.name, geoms, place.pose()[:3, 3], np.array(layout.tray_size)))
    mouths = np.array([spots[s] for s in slots]).reshape(-1, 3)
    return PackNames(tuple(d.name for d in draws), mouths @ T[:3, :3].T + T[:3, 3], "tray", tuple(found))


def _add_fasteners(
    spec: mujoco.MjSpec, body: mujoco.MjsBody, layout: PackLayout, loose: set[int], meshes: tuple[str, str]
) -> list[PackPart]:
    """Add the tight fasteners and list the empty holes; where they are is in the pack frame."""
    flats, height = FASTENER_HEAD
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
                nuts.add_bare_stud(body, at)
            else:
                found.append(nuts.add_tight(body, meshes, at, f"nut_{slot:02d}"))
        elif slot in layout.empty_holes:
            found.append(PackPart("screw_hole", "pack", (), at, np.array([0.006, 0.006, 0.0])))
        else:
            names = (f"fastener_{slot:02d}_flange", f"fastener_{slot:02d}_hex")
            parts.visual_mesh(body, flange, at, material="zinc", name=names[0])
            parts.visual_mesh(body, head, at, material="zinc", name=names[1])
            parts.collider(body, _CYLINDER, (0.006, height / 2), (x, y, z + height / 2))
            size = np.array([0.0144, 0.0144, height])
            found.append(PackPart("screw", "pack", names, at + [0, 0, height], size))
    return found
