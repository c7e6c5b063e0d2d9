"""Which points of a scan are the robot's own: those in or close to its spheres, with its joints where they are."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.robots.model.table import JOINT_NAMES
from golem.types import Array

MARGIN = 0.08
"""Distance from a sphere up to which a point is the robot's [m]: noise of the range, motion within a scan, cables."""


class RobotFilter:
    """Knows the robot's spheres.

    Attributes:
        model: them, on the 27 joints in motor order.
    """

    def __init__(self) -> None:
        """Load the spheres."""
        self.model = CollisionModel(load_spheres())
        self._order = [JOINT_NAMES.index(name) for name in self.model.joints]

    def balls(self, q: Array) -> Array:
        """Return the spheres (m, 4) at joints `q` (27,) in motor order: centre in base_link and radius [m]."""
        return self.model.placed(np.ascontiguousarray(q[self._order], float))

    def own(self, points: Array, q: Array) -> NDArray[np.bool_]:
        """Return which points (n, 3) in base_link [m] are the robot's at joints `q` (27,)."""
        balls = self.balls(q)
        reach = balls[:, 3, None] + MARGIN
        low, high = (balls[:, :3] - reach).min(axis=0), (balls[:, :3] + reach).max(axis=0)
        near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
        own = np.zeros(len(points), np.bool_)
        own[near] = _inside(np.ascontiguousarray(points[near]), balls, MARGIN)
        return own


@njit(cache=True, nogil=True)
def _inside(points: Array, balls: Array, margin: float) -> NDArray[np.bool_]:
    """Return which points (n, 3) are within `margin` [m] of a ball (m, 4)."""
    found = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        for j in range(len(balls)):
            square = 0.0
            for a in range(3):
                square += (points[i, a] - balls[j, a]) ** 2
            if square < (balls[j, 3] + margin) ** 2:
                found[i] = True
                break
    return found
