"""Finds where a scan was taken in a known cloud, from a rough guess, on the floor: x, y and heading.

First a search over a grid of places and headings by the distance of the points to the nearest known one, then
Gauss-Newton on the same distance (a likelihood field: Thrun, Burgard and Fox, Probabilistic Robotics, 2005, 6.4).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from golem.types import Array, PlanarPose, wrap

CELL = 0.05
"""Side of a cell of the distance field [m]."""
FAR = 0.6
"""Distance from which on a point does not pull any more [m]."""
ROUNDS = 40


@dataclass(frozen=True, slots=True)
class Match:
    """Where a scan fits.

    Attributes:
        pose: of the scan's frame in the cloud's.
        share: of its points that are within 0.15 m of a known one.
        residual: mean distance of those [m].
    """

    pose: PlanarPose
    share: float
    residual: float


class DistanceField:
    """How far each place of the floor is from the nearest known point."""

    def __init__(self, cloud: Array) -> None:
        """Draw the (n, 2) places of known points [m]; n is at least 1."""
        self._corner: Array = cloud.min(axis=0) - 2.0
        shape = np.ceil((cloud.max(axis=0) + 2.0 - self._corner) / CELL).astype(int)
        free = np.full((shape[1], shape[0]), 255, np.uint8)
        columns, rows = ((cloud - self._corner) / CELL).astype(int).T
        free[rows, columns] = 0
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL
        self._distance = np.minimum(distance, FAR).astype(np.float64)
        self._dy, self._dx = np.gradient(self._distance, CELL)

    def coarse(self, points: Array) -> Array:
        """Return the (..., ) distances at points (..., 2), of the nearest cell."""
        column, row = self._index(points)
        return self._distance[row, column]

    def fine(self, points: Array) -> tuple[Array, Array]:
        """Return the (n,) distances, interpolated, and the (n, 2) gradients at points (n, 2)."""
        x = (points - self._corner) / CELL - 0.5
        rows, columns = self._distance.shape
        c = np.clip(np.floor(x[:, 0]).astype(int), 0, columns - 2)
        r = np.clip(np.floor(x[:, 1]).astype(int), 0, rows - 2)
        u, v = np.clip(x[:, 0] - c, 0.0, 1.0), np.clip(x[:, 1] - r, 0.0, 1.0)

        def at(field: Array) -> Array:
            low = (1 - u) * field[r, c] + u * field[r, c + 1]
            return (1 - v) * low + v * ((1 - u) * field[r + 1, c] + u * field[r + 1, c + 1])

        return at(self._distance), np.column_stack([at(self._dx), at(self._dy)])

    def _index(self, points: Array) -> tuple[Array, Array]:
        rows, columns = self._distance.shape
        index = np.floor((points - self._corner) / CELL).astype(int)
        return np.clip(index[..., 0], 0, columns - 1), np.clip(index[..., 1], 0, rows - 1)


def search(field: DistanceField, points: Array, guess: PlanarPose, around: tuple[float, float]) -> PlanarPose:
    """Return the best of a grid of poses around a guess.

    Args:
        field: of the known cloud.
        points: (n, 2) of the scan in its own frame [m]; a few hundred.
        guess: where that frame roughly is.
        around: how far off the guess may be: [m], [rad].
    """
    shifts = np.arange(-around[0], around[0] + 1e-9, 0.1)
    turns = np.arange(-around[1], around[1] + 1e-9, np.radians(2.5))
    dx, dy = (a.ravel() for a in np.meshgrid(shifts, shifts))
    best, found = np.inf, guess
    for turn in turns:
        yaw = guess.yaw + turn
        c, s = np.cos(yaw), np.sin(yaw)
        turned = points @ np.array([[c, s], [-s, c]]) + (guess.x, guess.y)
        cost = field.coarse(turned[None] + np.column_stack([dx, dy])[:, None]).mean(axis=1)
        i = int(cost.argmin())
        if cost[i] < best:
            best, found = (
                float(cost[i]),
                PlanarPose(guess.x + float(dx[i]), guess.y + float(dy[i]), wrap(yaw)),
            )
    return found


def refine(field: DistanceField, points: Array, pose: PlanarPose) -> Match:
    """Return where the scan's points (n, 2) fit best near `pose`."""
    x = np.array([pose.x, pose.y, pose.yaw])
    for _ in range(ROUNDS):
        c, s = np.cos(x[2]), np.sin(x[2])
        turned = points @ np.array([[c, s], [-s, c]])
        distance, gradient = field.fine(turned + x[:2])
        # Cauchy's weights: what is new since the map was made pulls little.
        weight = np.where(distance < 0.95 * FAR, 1.0 / (1.0 + (distance / 0.1) ** 2), 0.0)
        spin = gradient[:, 1] * turned[:, 0] - gradient[:, 0] * turned[:, 1]
        J = np.column_stack([gradient, spin])
        H = (J * weight[:, None]).T @ J + 1e-6 * np.eye(3)
        step = -np.linalg.solve(H, (J * weight[:, None]).T @ distance)
        x += step
        if np.abs(step).max() < 1e-5:
            break
    c, s = np.cos(x[2]), np.sin(x[2])
    distance = field.fine(points @ np.array([[c, s], [-s, c]]) + x[:2])[0]
    near = distance < 0.15
    residual = float(distance[near].mean()) if near.any() else FAR
    return Match(PlanarPose(float(x[0]), float(x[1]), wrap(float(x[2]))), float(near.mean()), residual)
