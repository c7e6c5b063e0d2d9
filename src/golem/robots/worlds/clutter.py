"""Things that lie on the pack's cover: washers, a spanner, cable ends, a block of tape."""

from __future__ import annotations

import mujoco
import numpy as np

from golem.robots.worlds import parts
from golem.robots.worlds.layout import PackLayout, yaw_quat

CLEAR = 0.05
"""Distance that things keep from fasteners of the near edge, from trays and from the opened section [m]."""
ATTEMPTS = 30

_BOX = mujoco.mjtGeom.mjGEOM_BOX
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER
_CAPSULE = mujoco.mjtGeom.mjGEOM_CAPSULE


def add_clutter(spec: mujoco.MjSpec, layout: PackLayout, count: int, rng: np.random.Generator) -> int:
    """Put up to `count` things on the cover, fixed where they lie, and return how many found a place.

    Args:
        spec: the world, which has the body `pack`.
        layout: where pack and tray stand.
        count: how many.
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
        _THINGS[int(rng.integers(len(_THINGS)))](body)
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


def _washer(body: mujoco.MjsBody) -> None:
    parts.visual(body, _CYLINDER, (0.008, 0.0008), (0.0, 0.0, 0.0008), material="steel")
    parts.visual(body, _CYLINDER, (0.0035, 0.0009), (0.0, 0.0, 0.0009), material="dark")


def _spanner(body: mujoco.MjsBody) -> None:
    for size, pos in (((0.055, 0.008, 0.003), (0.0, 0.0, 0.003)), ((0.012, 0.014, 0.004), (0.06, 0.0, 0.004))):
        parts.visual(body, _BOX, size, pos, material="steel")
        parts.collider(body, _BOX, size, pos)


def _cable(body: mujoco.MjsBody) -> None:
    for k in range(4):
        pos = (-0.045 + 0.03 * k, 0.008 * (-1) ** k, 0.004)
        parts.visual(body, _CAPSULE, (0.004, 0.014), pos, material="hv_orange", quat=(0.5, 0.5, 0.5, 0.5))
    parts.collider(body, _BOX, (0.06, 0.014, 0.004), (0.0, 0.0, 0.004))


def _tape(body: mujoco.MjsBody) -> None:
    parts.visual(body, _CYLINDER, (0.028, 0.011), (0.0, 0.0, 0.011), material="dark")
    parts.visual(body, _CYLINDER, (0.018, 0.0112), (0.0, 0.0, 0.0112), material="label_white")
    parts.collider(body, _CYLINDER, (0.028, 0.011), (0.0, 0.0, 0.011))


def _plug(body: mujoco.MjsBody) -> None:
    parts.visual(body, _BOX, (0.018, 0.012, 0.010), (0.0, 0.0, 0.010), material="module_cap")
    parts.visual(
        body, _CYLINDER, (0.006, 0.012), (0.026, 0.0, 0.010), material="hv_orange", quat=(0.7071, 0.0, 0.7071, 0.0)
    )
    parts.collider(body, _BOX, (0.018, 0.012, 0.010), (0.0, 0.0, 0.010))


_THINGS = (_washer, _spanner, _cable, _tape, _plug)
