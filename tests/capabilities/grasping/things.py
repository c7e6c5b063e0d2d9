"""Clouds of things as one camera sees them: a can on a table, a bar before a door, a bottle."""

from __future__ import annotations

import numpy as np

from golem.types import Array, Detection, LocalizedObject

CAN = np.array([0.55, -0.25, 0.04])
"""Where the can stands [m]."""
BAR = np.array([0.58, -0.25, 0.10])
"""Lower end of the bar's axis [m]."""


def seen(points: Array, position: Array, label: str = "can") -> LocalizedObject:
    """Return a sighting of `points` at `position`."""
    box = np.array([0.0, 0.0, 10.0, 10.0])
    return LocalizedObject(Detection(label, 0.9, box, box[:2] + 5), 0.0, position, points)


def can(noise: float = 0.001, n: int = 2000) -> LocalizedObject:
    """Return the visible half of a can of 68 x 120 mm on a table, seen from the robot's head."""
    rng = np.random.default_rng(0)
    angle, height = rng.uniform(0.0, 2 * np.pi, 4 * n), rng.uniform(0.0, 0.12, 4 * n)
    normal = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    side = CAN + 0.034 * normal
    side[:, 2] += height
    side = side[((np.array([0.0, 0.0, 0.5]) - side) * normal).sum(axis=1) > 0.0][: int(0.6 * n)]
    radius, turn = 0.034 * np.sqrt(rng.random(n // 5)), rng.uniform(0.0, 2 * np.pi, n // 5)
    top = CAN + np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full(n // 5, 0.12)])
    table = CAN + np.column_stack([rng.uniform(-0.06, 0.06, (n, 2)), np.zeros(n)])
    points = np.concatenate([side, top, table])
    return seen(points + noise * rng.standard_normal(points.shape), CAN + (-0.034, 0.0, 0.06))


def bar(noise: float = 0.002) -> LocalizedObject:
    """Return the visible half of an upright bar of 25 mm, 5 cm before a door."""
    rng = np.random.default_rng(0)
    angle = rng.uniform(np.pi / 2, 3 * np.pi / 2, 600)
    handle = BAR + np.column_stack([0.0125 * np.cos(angle), 0.0125 * np.sin(angle), rng.uniform(0.0, 0.3, 600)])
    door = np.column_stack([np.full(1500, 0.63), rng.uniform(-0.30, -0.20, 1500), rng.uniform(0.1, 0.4, 1500)])
    points = np.concatenate([handle, door])
    return seen(points + noise * rng.standard_normal(points.shape), BAR + (-0.0125, 0.0, 0.15), label="handle")


BOTTLE = np.array([0.50, -0.20, 0.10])
"""Where the bottle stands [m]: 70 mm wide up to 136 mm, its cap 31 mm wide, 220 mm above its foot."""


def bottle(*, above: bool, noise: float = 0.0007) -> LocalizedObject:
    """Return a bottle without the table below it: as seen from above, cap and shoulder, or its front half."""
    rng = np.random.default_rng(0)
    turn = rng.uniform(-np.pi, np.pi, 1200) if above else rng.uniform(0.5 * np.pi, 1.5 * np.pi, 1200)
    up = rng.uniform(0.136, 0.180, 1200) if above else rng.uniform(0.012, 0.220, 1200)
    radius = np.clip(0.035 - 0.35 * (up - 0.136), 0.0155, 0.035)
    wall = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), up])
    cap = 0.0155 * np.sqrt(rng.random(400)), rng.uniform(-np.pi, np.pi, 400)
    top = np.column_stack([cap[0] * np.cos(cap[1]), cap[0] * np.sin(cap[1]), np.full(400, 0.220)])
    points = np.concatenate([wall, top]) if above else wall
    place = BOTTLE + ((0.0, 0.0, 0.220) if above else (-0.030, 0.005, 0.11))
    return seen(BOTTLE + points + noise * rng.standard_normal(points.shape), place, label="bottle")
