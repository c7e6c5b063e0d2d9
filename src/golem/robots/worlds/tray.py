"""The open box that takes the pulled screws."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.layout import PackLayout, TrayPlace, yaw_quat

WALL = 0.003
_BOX = mujoco.mjtGeom.mjGEOM_BOX


def add_tray(spec: mujoco.MjSpec, layout: PackLayout, place: TrayPlace) -> None:
    """Add the tray as a static body at its underside's centre, on a pedestal when it stands off the cover."""
    sx, sy, sz = layout.tray_size
    paint = "stand_blue" if place.kind == "nut" else "tray_teal"
    body = spec.worldbody.add_body(name=place.name, pos=[place.x, place.y, place.z], quat=yaw_quat(place.yaw))
    hx, hy, hz = sx / 2, sy / 2, sz / 2
    walls = [
        ((hx, hy, WALL / 2), (0.0, 0.0, WALL / 2)),
        ((WALL / 2, hy, hz), (hx - WALL / 2, 0.0, hz)),
        ((WALL / 2, hy, hz), (-hx + WALL / 2, 0.0, hz)),
        ((hx, WALL / 2, hz), (0.0, hy - WALL / 2, hz)),
        ((hx, WALL / 2, hz), (0.0, -hy + WALL / 2, hz)),
    ]
    for k, (size, pos) in enumerate(walls):
        parts.collider(body, _BOX, size, pos, friction=0.8)
        parts.visual(body, _BOX, size, pos, material=paint, name=f"{place.name}_part_{k}")
    rim = 0.006
    for k, (size, pos) in enumerate(
        [
            ((rim / 2, hy + rim / 2, 0.0015), (hx, 0.0, sz)),
            ((rim / 2, hy + rim / 2, 0.0015), (-hx, 0.0, sz)),
            ((hx + rim / 2, rim / 2, 0.0015), (0.0, hy, sz)),
            ((hx + rim / 2, rim / 2, 0.0015), (0.0, -hy, sz)),
        ]
    ):
        parts.visual(body, _BOX, size, pos, material=paint, name=f"{place.name}_rim_{k}")
    x, y, _, _ = np.linalg.inv(layout.pose()) @ (place.x, place.y, place.z, 1.0)
    over_cover = 0.0 < x < layout.size_x and abs(y) < layout.size_y / 2
    foot = layout.top_z if over_cover else 0.0
    if place.z - foot > 0.005:
        post = (place.z - foot) / 2
        radius = 0.03
        parts.visual(body, mujoco.mjtGeom.mjGEOM_CYLINDER, (radius, post), (0, 0, -post), material="stand_blue")
        parts.collider(body, mujoco.mjtGeom.mjGEOM_CYLINDER, (radius, post), (0, 0, -post))
        if not over_cover:
            parts.visual(body, _BOX, (hx, hy, 0.01), (0, 0, -2 * post + 0.01), material="stand_blue")
