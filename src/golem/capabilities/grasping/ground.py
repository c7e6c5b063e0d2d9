"""Which way the ground faces around a small object, and how high it stands on it, from the cloud of one sighting."""

from __future__ import annotations

import numpy as np

from golem.types import Array, LocalizedObject

STANDS_PROUD = 0.004
"""What is less than this below the object's top is the object [m]."""
THICKNESS = 0.004
"""Points further than this from the first plane are not ground [m]."""
MIN_POINTS = 60
"""Fewer points give no plane."""
STEEPEST = 0.35
"""A plane steeper than this against the vertical is not the ground the object stands on [rad]."""


def height_above_ground(sighting: LocalizedObject) -> float | None:
    """Return how high the object's top is above the lowest tenth of its cloud [m]; None without a cloud."""
    if len(sighting.points) == 0:
        return None
    return float(sighting.position[2]) - float(np.quantile(sighting.points[:, 2], 0.1))


def ground_plane(sighting: LocalizedObject) -> tuple[Array, float] | None:
    """Return the ground around the object and how high its top is above it; None where it cannot be told.

    A least-squares plane z = a x + b y + c through the points below the object's top, fitted twice: the second time
    without what lies off the first plane.

    Returns:
        the (3,) unit normal of the plane, upwards, and the height of the object's top above it [m].
    """
    points = sighting.points[sighting.points[:, 2] < sighting.position[2] - STANDS_PROUD]
    normal, height = None, 0.0
    for _ in range(2):
        if len(points) < MIN_POINTS:
            return None
        middle = points.mean(axis=0)
        d = points - middle
        xx, xy, yy = d[:, 0] @ d[:, 0], d[:, 0] @ d[:, 1], d[:, 1] @ d[:, 1]
        xz, yz = d[:, 0] @ d[:, 2], d[:, 1] @ d[:, 2]
        determinant = xx * yy - xy * xy
        if determinant < 1e-4 * (xx + yy) ** 2:
            return None
        a = (xz * yy - yz * xy) / determinant
        b = (yz * xx - xz * xy) / determinant
        points = points[np.abs(d[:, 2] - a * d[:, 0] - b * d[:, 1]) < THICKNESS]
        normal = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
        height = float((sighting.position - middle) @ normal)
    return (normal, height) if normal is not None and np.arccos(normal[2]) < STEEPEST else None
