"""Poses the points of a scan, each at its own time, and leaves out the robot's own: those close to its spheres."""

from __future__ import annotations

import math

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
    """Knows the robot's spheres: `model` has them, on the 27 joints in motor order."""

    def __init__(self) -> None:
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


@njit(cache=True, nogil=True, error_model="numpy")
def sound(points: Array, offsets: Array, blind: float) -> NDArray[np.bool_]:
    """Return which points (n, 3) and offsets (n,) are finite, the point farther than `blind` [m] from the sensor."""
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        square = x * x + y * y + z * z
        out[i] = square > blind * blind and math.isfinite(square) and math.isfinite(offsets[i])
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def posed(points: Array, offsets: Array, duration: float, R: Array, p: Array) -> Array:
    """Return points where the sensor was at their own times, its motion between two moments taken as straight.

    Args:
        points: (n, 3) in the sensor's frame [m].
        offsets: (n,) time of each after the scan's begin, from 0 to `duration` [s].
        duration: of the scan [s].
        R: (m, 3, 3) rotations of the sensor at m moments, evenly over the scan.
        p: (m, 3) its places [m].
    """
    out = np.empty((len(points), 3))
    parts = len(R) - 1
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        along = offsets[i] / duration * parts
        k = min(int(along), parts - 1)
        share = along - k
        for a in range(3):
            early = R[k, a, 0] * x + R[k, a, 1] * y + R[k, a, 2] * z + p[k, a]
            late = R[k + 1, a, 0] * x + R[k + 1, a, 1] * y + R[k + 1, a, 2] * z + p[k + 1, a]
            out[i, a] = early + share * (late - early)
    return out
