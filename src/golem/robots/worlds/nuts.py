"""Flange nuts on studs: tight ones that belong to the pack, and loosened ones that lift off.

A loosened nut is a ring of six boxes around its stud. It stands on a collar that is narrower than the nut: the passive
stand-in for the thread that it still hangs in, as a bore's bottom is for a screw.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.pack_part import PackPart
from golem.robots.worlds.screws import SOLREF, ScrewDraw, loosened
from golem.types import Array

FLATS, COLLAR = 0.8, 0.0042
"""Width across flats per diameter of the flange; radius of what a loosened nut stands on [m]."""

_BOX = mujoco.mjtGeom.mjGEOM_BOX
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER


def add_meshes(spec: mujoco.MjSpec) -> None:
    """Add the meshes of tight nuts and their washers."""
    parts.add_mesh(spec, "nut", *parts.hexagon(0.010, 0.006))
    parts.add_mesh(spec, "washer", *parts.lathe([(0.0085, 0.0), (0.0085, 0.0012)], sides=24))


def add_bare(body: mujoco.MjsBody, seat: Sequence[float]) -> None:
    """Add a stud at `seat` (3,) whose nut is gone."""
    size, pos = (0.003, 0.006), (seat[0], seat[1], seat[2] + 0.006)
    parts.visual(body, _CYLINDER, size, pos, material="steel")
    parts.collider(body, _CYLINDER, size, pos)


def add_tight(body: mujoco.MjsBody, seat: Sequence[float], label: str) -> PackPart:
    """Add a tight nut on its stud at `seat` (3,) in the frame of the pack's `body`; its part is in that frame."""
    x, y, base = seat
    parts.visual_mesh(body, "washer", (x, y, base), material="steel", name=f"{label}_washer")
    parts.visual_mesh(body, "nut", (x, y, base + 0.0012), material="zinc", name=f"{label}_hex")
    parts.visual(body, _CYLINDER, (0.003, 0.006), (x, y, base + 0.006), material="steel", name=f"{label}_stud")
    parts.collider(body, _CYLINDER, (0.0055, 0.006), (x, y, base + 0.006))
    geoms = (f"{label}_washer", f"{label}_hex", f"{label}_stud")
    return PackPart("nut", "pack", geoms, np.array([x, y, base + 0.0072]), np.array([0.017, 0.017, 0.012]))


def add_stud(parent: mujoco.MjsBody, draw: ScrewDraw, seat: Sequence[float]) -> None:
    """Add the stud of a loosened nut as a static body at `seat` (3,) in the parent frame, and its collar."""
    body = parent.add_body(name=f"stud_{draw.slot:02d}", pos=list(seat), quat=draw.quat())
    for radius, length in ((draw.shank_diameter / 2, draw.shank_length), (COLLAR, draw.protrusion)):
        size, pos = (radius, length / 2), (0.0, 0.0, length / 2)
        parts.collider(body, _CYLINDER, size, pos, friction=draw.friction, solref=SOLREF)
    size, pos = (draw.shank_diameter / 2, draw.shank_length / 2), (0.0, 0.0, draw.shank_length / 2)
    parts.visual(body, _CYLINDER, size, pos, material="steel")
    parts.visual(body, _CYLINDER, (0.0085, 0.0006), (0.0, 0.0, 0.0006), material="steel")


def add_nut(
    spec: mujoco.MjSpec, draw: ScrewDraw, spot: Sequence[float], T_world_pack: Array, *, sleep: bool = True
) -> str:
    """Add the free body of a loosened nut around its stud; arguments and result as of `screws.add_screw`."""
    name, body = draw.name, loosened(spec, draw, spot, T_world_pack, sleep=sleep)
    inner, outer, height = draw.bore_radius, FLATS * draw.head_diameter / 2, draw.head_height
    for k in range(6):
        a, mid = (k + 0.5) * np.pi / 3, (inner + outer) / 2
        parts.collider(
            body, _BOX, ((outer - inner) / 2, outer * np.tan(np.pi / 6), height / 2),
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
