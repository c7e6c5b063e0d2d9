"""Where the floor is: a plane through what a LiDAR sees of it, followed from scan to scan."""

from __future__ import annotations

import numpy as np

from golem.kernels import njit
from golem.types import Array

SENSOR_HEIGHT = 1.68
"""Height of lidar_link above the floor under a robot that stands [m]: where the search begins."""
REACH = 5.0
"""Distance up to which points of the floor are looked for [m]."""
BEGIN, FOLLOW = 0.25, 0.06
"""Distance from the plane within which a point may be the floor's at first, and once the plane is known [m]."""
FEWEST = 80
"""Points that fix a plane."""
STEEPEST = 0.04
"""Largest slope of the plane [rad]: an error of odom's level; a ramp is none of its business."""
SHARE = 0.2
"""Share of the way to the newest plane that the kept one goes with every scan."""


class FloorPlane:
    """Follows the plane z = a x + b y + c in odom: (3,) a, b [m/m] and c [m], None before the first scan."""

    def __init__(self) -> None:
        self.plane: Array | None = None
        self._found = False

    def update(self, points: Array, origin: Array) -> Array:
        """Return the plane after the (n, 3) `points` of a scan in odom, finite [m], from `origin` (3,)."""
        if self.plane is None:
            self.plane = np.array([0.0, 0.0, origin[2] - SENSOR_HEIGHT])
        tolerance = FOLLOW if self._found else BEGIN
        floor, off = _close(points, origin, self.plane, tolerance)
        if len(floor) < FEWEST:
            return self.plane
        if not self._found:
            # The fullest slice of 4 cm: whatever else is near the floor has fewer points.
            counts, edges = np.histogram(off, bins=12, range=(-tolerance, tolerance))
            middle = edges[int(counts.argmax())] + tolerance / 12.0
            floor = floor[np.abs(off - middle) < 0.04]
            if len(floor) < FEWEST:
                return self.plane
        floor = floor[:: max(1, len(floor) // 1000)]
        rows = np.column_stack([floor[:, :2] - origin[:2], np.ones(len(floor))])
        a, b, c = np.linalg.lstsq(rows, floor[:, 2], rcond=None)[0]
        a, b = np.clip((a, b), -STEEPEST, STEEPEST)
        newest = np.array([a, b, c - a * origin[0] - b * origin[1]])
        self.plane = newest if not self._found else self.plane + SHARE * (newest - self.plane)
        self._found = True
        return self.plane


@njit(cache=True, nogil=True, error_model="numpy")
def _close(points: Array, origin: Array, plane: Array, tolerance: float) -> tuple[Array, Array]:
    """Return the points (n, 3) less than `tolerance` from the plane and `REACH` from `origin`, and their heights."""
    out, heights = np.empty(points.shape), np.empty(len(points))
    n = 0
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        off = z - (x * plane[0] + y * plane[1]) - plane[2]
        u, v = x - origin[0], y - origin[1]
        if abs(off) < tolerance and u * u + v * v < REACH * REACH:
            out[n, 0], out[n, 1], out[n, 2], heights[n] = x, y, z, off
            n += 1
    return out[:n], heights[:n]
