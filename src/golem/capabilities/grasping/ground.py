"""Which way the ground faces around a small object, from the cloud of one sighting."""

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


def ground_normal(sighting: LocalizedObject) -> Array | None:
    """Return the (3,) unit normal, upwards, of the plane around the object; None where it cannot be told.

    A least-squares plane z = a x + b y + c through the points below the object's top, fitted twice: the second time
    without what lies off the first plane.
    """
    points = sighting.points[sighting.points[:, 2] < sighting.position[2] - STANDS_PROUD]
    normal = None
    for _ in range(2):
        if len(points) < MIN_POINTS:
            return None
        d = points - points.mean(axis=0)
        xx, xy, yy = d[:, 0] @ d[:, 0], d[:, 0] @ d[:, 1], d[:, 1] @ d[:, 1]
        xz, yz = d[:, 0] @ d[:, 2], d[:, 1] @ d[:, 2]
        determinant = xx * yy - xy * xy
        if determinant < 1e-4 * (xx + yy) ** 2:
            return None
        a = (xz * yy - yz * xy) / determinant
        b = (yz * xx - xz * xy) / determinant
        points = points[np.abs(d[:, 2] - a * d[:, 0] - b * d[:, 1]) < THICKNESS]
        normal = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
    return normal if normal is not None and np.arccos(normal[2]) < STEEPEST else None
