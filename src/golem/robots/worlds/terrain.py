"""Grounds to stand and walk on: the empty hall, a ramp, a step, a field of uneven tiles."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from golem.robots.worlds import hall, parts
from golem.robots.worlds.parts import BOX

FLAT = 1.0
"""Half side of the flat square around the start [m]."""
HALL = 10.0
"""Half side of the hall [m]: room for six metres straight ahead."""
RAMP = (3.0, 1.5, 4.0)
"""Length of the ramp's slope and of the platform behind it, and its width [m]; then it goes down again."""
PLATFORM = (1.5, 4.0)
"""Length and width of what the step leads up to [m]; then it goes down again."""
TILE = 0.3
"""Side of a tile [m]: a foot of 0.26 m rarely has one for itself."""
FIELD = 4.0
"""Half side of the field of tiles [m]."""

_THICK = 0.1


def add_open(spec: mujoco.MjSpec) -> None:
    """Add the empty hall."""
    hall.add_materials(spec)
    hall.add_hall(spec, HALL, marks=False)


def add_slope(spec: mujoco.MjSpec, angle: float) -> None:
    """Add a hall with a ramp of `angle` [rad] across the way of who walks ahead: up, a platform, down."""
    add_open(spec)
    length, level, width = RAMP
    c, s = math.cos(angle), math.sin(angle)
    rise, run = length * s, length * c
    body = spec.worldbody.add_body(name="terrain", pos=[FLAT, 0.0, 0.0])
    half = _THICK / 2
    # Each box lies half its thickness below the middle of its top, along its normal; up is a negative turn about y.
    for x, turn in ((run / 2, -1.0), (run * 1.5 + level, 1.0)):
        quat = (math.cos(angle / 2), 0.0, turn * math.sin(angle / 2), 0.0)
        _block(body, (length / 2, width / 2, half), (x - turn * s * half, 0.0, rise / 2 - c * half), quat=quat)
    _block(body, (level / 2, width / 2, half), (run + level / 2, 0.0, rise - half))


def add_step(spec: mujoco.MjSpec, height: float) -> None:
    """Add a hall with a platform, `height` [m] up, across the way of who walks ahead."""
    add_open(spec)
    length, width = PLATFORM
    body = spec.worldbody.add_body(name="terrain")
    size = (length / 2, width / 2, _THICK / 2)
    _block(body, size, (FLAT + length / 2, 0.0, height - _THICK / 2))


def add_rubble(spec: mujoco.MjSpec, height: float, rng: np.random.Generator) -> None:
    """Add a hall whose floor around the start is laid with tiles of uneven height.

    Args:
        height: of the highest tile [m]; every tile's is drawn evenly from 0 to it, so a step is that high at most.
        rng: draws the heights.
    """
    add_open(spec)
    body = spec.worldbody.add_body(name="terrain")
    count = round(2 * FIELD / TILE)
    heights = height * rng.random((count, count))
    middles = TILE * (np.arange(count) - (count - 1) / 2)
    for i, x in enumerate(middles):
        for j, y in enumerate(middles):
            if max(abs(x), abs(y)) - TILE / 2 < FLAT:
                continue
            shade = 0.45 + 0.25 * float(heights[i, j]) / max(height, 1e-9)
            size = (TILE / 2, TILE / 2, _THICK / 2)
            _block(body, size, (x, y, float(heights[i, j]) - _THICK / 2), shade=shade)


def _block(
    body: mujoco.MjsBody,
    size: tuple[float, float, float],
    pos: tuple[float, float, float],
    *,
    quat: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0),
    shade: float = 0.62,
) -> None:
    geom = parts.collider(body, BOX, size, pos, quat=quat, friction=hall.FLOOR_FRICTION)
    geom.rgba = [shade, shade, 0.95 * shade, 1.0]
    geom.group = parts.VISUAL_GROUP
