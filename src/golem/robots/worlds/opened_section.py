"""The opened section of a pack's cover: modules, bus bars, and the nuts that hold them."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.worlds import nuts, parts
from golem.robots.worlds.layout import PackLayout
from golem.robots.worlds.pack_part import PackPart

STUD_PITCH = 0.09

_BOX = mujoco.mjtGeom.mjGEOM_BOX


def add_window(body: mujoco.MjsBody, layout: PackLayout, meshes: tuple[str, str]) -> list[PackPart]:
    """Add modules, bus bars and nuts, of `nuts.add_meshes`, in the opened section; places are in the pack frame."""
    (x0, x1), (y0, y1), depth = layout.window_x, layout.window_y, layout.window_depth
    floor = -depth
    cx, cy, hx, hy = (x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2
    parts.collider(body, _BOX, (hx, hy, 0.01), (cx, cy, floor - 0.01))
    parts.visual(body, _BOX, (hx, hy, 0.01), (cx, cy, floor - 0.012), material="dark")
    lip = 0.004
    for size, pos in (
        ((hx + lip, lip / 2, 0.001), (cx, y0 - lip / 2, 0.0005)),
        ((hx + lip, lip / 2, 0.001), (cx, y1 + lip / 2, 0.0005)),
        ((lip / 2, hy, 0.001), (x0 - lip / 2, cy, 0.0005)),
        ((lip / 2, hy, 0.001), (x1 + lip / 2, cy, 0.0005)),
    ):
        parts.visual(body, _BOX, size, pos, material="steel")
    columns = int((y1 - y0 - 0.02) // (2 * STUD_PITCH))
    pitch = 2 * STUD_PITCH
    start = cy - pitch * columns / 2
    found: list[PackPart] = []
    for row in range(2):
        mx = x0 + (0.27 + 0.46 * row) * (x1 - x0)
        for col in range(columns):
            my = start + pitch * (col + 0.5)
            parts.visual(body, _BOX, (0.095, pitch / 2 - 0.006, 0.009), (mx, my, floor + 0.001),
                         material="module_black")  # fmt: skip
            for end in (-1, 1):
                parts.visual(body, _BOX, (0.012, pitch / 2 - 0.012, 0.004), (mx + end * 0.078, my, floor + 0.012),
                             material="module_cap")  # fmt: skip
            for rib in (-0.03, 0.0, 0.03):
                parts.visual(body, _BOX, (0.004, pitch / 2 - 0.02, 0.001), (mx + rib, my, floor + 0.0105),
                             material="module_cap")  # fmt: skip
    top = floor + 0.014
    for row in range(2):
        for col in range(columns - 1):
            by = start + pitch * (col + 1)
            for k, offset in enumerate((-0.05, 0.045)):
                if (row + 2 * col + k) % 4 == 3:
                    continue
                bx = x0 + (0.27 + 0.46 * row) * (x1 - x0) + offset
                name = f"bus_bar_{row}{col}{k}"
                found += _add_bus_bar(body, (bx, by, top), name, meshes, along=1)
    bx, by = cx, start + pitch * (columns - 0.5)
    found += _add_bus_bar(body, (bx, by, top), "bus_bar_link", meshes, along=0)
    return found


def _add_bus_bar(
    body: mujoco.MjsBody, pos: tuple[float, float, float], name: str, meshes: tuple[str, str], *, along: int
) -> list[PackPart]:
    """Add one bar with an orange sleeve, a nut on a stud at each end, and their colliders."""
    half = STUD_PITCH / 2 + 0.016
    x, y, z = pos
    thick = 0.0015
    bar = (0.011, half, thick) if along else (half, 0.011, thick)
    sleeve = (0.013, half - 0.034, 0.0045) if along else (half - 0.034, 0.013, 0.0045)
    parts.visual(body, _BOX, bar, (x, y, z), material="copper", name=f"{name}_bar")
    parts.visual(body, _BOX, sleeve, (x, y, z + 0.001), material="hv_orange", name=f"{name}_sleeve")
    parts.collider(body, _BOX, bar, (x, y, z))
    extent = np.array([2 * bar[0], 2 * bar[1], 2 * sleeve[2]])
    centre = np.array([x, y, z + 0.0055])
    found = [PackPart("bus_bar", "pack", (f"{name}_bar", f"{name}_sleeve"), centre, extent)]
    for end in (-1, 1):
        nx, ny = (x, y + end * STUD_PITCH / 2) if along else (x + end * STUD_PITCH / 2, y)
        label = f"nut_{name[8:]}_{'b' if end > 0 else 'a'}"
        found.append(nuts.add_tight(body, meshes, (nx, ny, z + thick), label))
    return found
