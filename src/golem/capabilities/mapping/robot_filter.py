"""Which points of a scan are the robot's own: those in or close to its spheres, with its joints where they are."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.sphere_robot import load_spheres
from golem.kernels import njit
from golem.robots.model.table import JOINT_NAMES
from golem.types import SIDES, Array

MARGIN = 0.08
"""Distance from a sphere up to which a point is the robot's [m]: noise of the range, motion within a scan, cables."""
ASTRAY = 0.12
"""How much further that is per distance from an arm's shoulder [rad]: a hand whose joints count from wrong zeros is
beside where they say (profile `field`: by up to 75 mm in 40 robots)."""


class RobotFilter:
    """Knows the robot's spheres.

    Attributes:
        model: them, on the 27 joints in motor order.
    """

    def __init__(self) -> None:
        """Load the spheres."""
        self.model = CollisionModel(load_spheres())
        self._order = [JOINT_NAMES.index(name) for name in self.model.joints]
        links = [link.name for link in self.model.robot.links]
        self._arms: list[tuple[int, NDArray[np.intp]]] = []
        for side in SIDES:
            first = links.index(f"{side}_shoulder_pitch_link")
            own = [i for i in range(first, len(links)) if links[i].startswith(side)]
            balls = np.nonzero(np.isin(self.model.sphere_link, own))[0]
            self._arms.append((int(balls[0]), balls))

    def balls(self, q: Array) -> Array:
        """Return the spheres (m, 4) at joints `q` (27,) in motor order: centre in base_link and radius [m]."""
        return self.model.placed(np.ascontiguousarray(q[self._order], float))

    def own(self, points: Array, q: Array) -> NDArray[np.bool_]:
        """Return which points (n, 3) in base_link [m] are the robot's at joints `q` (27,)."""
        balls = self.balls(q)
        for shoulder, arm in self._arms:
            balls[arm, 3] += ASTRAY * np.linalg.norm(balls[arm, :3] - balls[shoulder, :3], axis=1)
        return _inside(points, balls, MARGIN)


@njit(cache=True, nogil=True, error_model="numpy")
def _inside(points: Array, balls: Array, margin: float) -> NDArray[np.bool_]:
    """Return which points (n, 3) are within `margin` [m] of a ball (m, 4)."""
    found = np.zeros(len(points), np.bool_)
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for j in range(len(balls)):
        for a in range(3):
            low[a] = min(low[a], balls[j, a] - balls[j, 3] - margin)
            high[a] = max(high[a], balls[j, a] + balls[j, 3] + margin)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if not (low[0] < x < high[0] and low[1] < y < high[1] and low[2] < z < high[2]):
            continue
        for j in range(len(balls)):
            u, v, w = x - balls[j, 0], y - balls[j, 1], z - balls[j, 2]
            if u * u + v * v + w * w < (balls[j, 3] + margin) ** 2:
                found[i] = True
                break
    return found
