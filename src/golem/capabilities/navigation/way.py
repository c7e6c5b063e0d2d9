"""A way over the floor as a line of places: where on it the robot is, and what lies ahead."""

from __future__ import annotations

import math

import numpy as np

from golem.types import Array, PlanarPose


class Way:
    """Places in their order.

    Attributes:
        points: (n, 2) at most a cell apart, n at least 1 [m].
    """

    def __init__(self, points: Array) -> None:
        """Follow `points`, with the corners of the grid taken off."""
        self.points = _smooth(points)
        steps = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        self._along: Array = np.concatenate([[0.0], np.cumsum(steps)])

    def nearest(self, pose: PlanarPose) -> tuple[int, float]:
        """Return the place nearest to a pose, and its distance [m]."""
        off = np.hypot(self.points[:, 0] - pose.x, self.points[:, 1] - pose.y)
        i = int(off.argmin())
        return i, float(off[i])

    def left(self, i: int) -> float:
        """Return the length of the way from place `i` to its end [m]."""
        return float(self._along[-1] - self._along[i])

    def ahead(self, i: int, distance: float) -> PlanarPose:
        """Return the place `distance` [m] ahead of place `i`, or the end, and the heading of the way there."""
        j = min(int(np.searchsorted(self._along, self._along[i] + distance)), len(self.points) - 1)
        a, b = self.points[max(0, j - 4)], self.points[j]
        heading = math.atan2(b[1] - a[1], b[0] - a[0]) if j > 0 else 0.0
        return PlanarPose(float(b[0]), float(b[1]), heading)


def _smooth(points: Array, width: int = 5) -> Array:
    """Return the mean of `width` neighbours at each place, fewer towards the ends, which stay."""
    n = len(points)
    if n < 3:
        return points
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(points, axis=0)])
    i = np.arange(n)
    half = np.minimum(np.minimum(i, n - 1 - i), width)
    return (total[i + half + 1] - total[i - half]) / (2 * half + 1)[:, None]
