"""Finds where a scan was taken among known landmarks, from a rough guess, on the floor: x, y and heading.

First a search over a grid of places and headings by the distance of the points to the nearest landmark, then point to
line: each point goes to the line through the landmarks around the one that is nearest (Censi, ICRA 2008).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from golem.types import Array, PlanarPose, wrap

CELL = 0.05
"""Side of a cell of the distance field of the search [m]."""
FAR = 0.6
"""Distance from which on a point does not count any more in the search [m]."""
NEIGHBOURS = 8
"""Landmarks that make a line."""
ROUNDS = 20


@dataclass(frozen=True, slots=True)
class Match:
    """Where a scan fits.

    Attributes:
        pose: of the scan's frame in the landmarks'.
        share: of its points that are within 0.15 m of a landmark.
    """

    pose: PlanarPose
    share: float


class Landmarks:
    """Places of what stands upright."""

    def __init__(self, places: Array) -> None:
        """Take (n, 2) places [m]; n is at least 1."""
        self._tree = KDTree(places)
        n = min(NEIGHBOURS, len(places))
        around = places[self._tree.query(places, n)[1].reshape(len(places), n)]
        off = around - around.mean(axis=1, keepdims=True)
        # The eigenvector of the smaller eigenvalue is across the line; what is no line pulls to its middle.
        _, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", off, off))
        self._normals: Array = vectors[:, :, 0]
        self._middles: Array = around.mean(axis=1)
        self._corner: Array = places.min(axis=0) - 2.0
        shape = np.ceil((places.max(axis=0) + 2.0 - self._corner) / CELL).astype(int)
        free = np.full((shape[1], shape[0]), 255, np.uint8)
        columns, rows = ((places - self._corner) / CELL).astype(int).T
        free[rows, columns] = 0
        distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL
        self._distance: Array = np.minimum(distance, FAR).astype(np.float64)

    def search(self, points: Array, guess: PlanarPose, around: tuple[float, float]) -> PlanarPose:
        """Return the best of a grid of poses around a guess.

        Args:
            points: (n, 2) of the scan in its own frame [m]; a few hundred.
            guess: where that frame roughly is.
            around: how far off the guess may be: [m], [rad].
        """
        shifts = np.arange(-around[0], around[0] + 1e-9, 0.1)
        dx, dy = (a.ravel() for a in np.meshgrid(shifts, shifts))
        best, found = np.inf, guess
        for turn in np.arange(-around[1], around[1] + 1e-9, np.radians(2.5)):
            turned = _moved(points, np.array([guess.x, guess.y, guess.yaw + turn]))
            cost = self._coarse(turned[None] + np.column_stack([dx, dy])[:, None]).mean(axis=1)
            i = int(cost.argmin())
            if cost[i] < best:
                best = float(cost[i])
                found = PlanarPose(guess.x + float(dx[i]), guess.y + float(dy[i]), wrap(guess.yaw + float(turn)))
        return found

    def refine(self, points: Array, pose: PlanarPose) -> Match:
        """Return where the scan's points (n, 2) fit best near `pose`."""
        x, reach = np.array([pose.x, pose.y, pose.yaw]), 0.5
        for _ in range(ROUNDS):
            at = _moved(points, x)
            distance, index = self._nearest(at, reach)
            kept = np.isfinite(distance)
            if kept.sum() < 3:
                break
            normals, off = self._normals[index[kept]], at[kept] - self._middles[index[kept]]
            residual = (normals * off).sum(axis=1)
            weight = 1.0 / (1.0 + (residual / 0.05) ** 2)
            arm = at[kept] - x[:2]
            J = np.column_stack([normals, normals[:, 1] * arm[:, 0] - normals[:, 0] * arm[:, 1]])
            H = (J * weight[:, None]).T @ J + 1e-6 * np.eye(3)
            step = -np.linalg.solve(H, (J * weight[:, None]).T @ residual)
            x, reach = x + step, max(0.15, 0.7 * reach)
            if np.abs(step).max() < 1e-5:
                break
        near = np.isfinite(self._nearest(_moved(points, x), 0.15)[0])
        return Match(PlanarPose(float(x[0]), float(x[1]), wrap(float(x[2]))), float(near.mean()))

    def _nearest(self, points: Array, reach: float) -> tuple[Array, NDArray[np.int64]]:
        """Return the (n,) distance of the landmark nearest to each point (n, 2), infinite beyond `reach`, and which."""
        distance, index = self._tree.query(points, distance_upper_bound=reach)
        return np.asarray(distance, np.float64), np.asarray(index, np.int64)

    def _coarse(self, points: Array) -> Array:
        """Return the (...,) distance of points (..., 2) from the nearest landmark, by its cell."""
        rows, columns = self._distance.shape
        index = np.floor((points - self._corner) / CELL).astype(int)
        return self._distance[np.clip(index[..., 1], 0, rows - 1), np.clip(index[..., 0], 0, columns - 1)]


def _moved(points: Array, pose: Array) -> Array:
    """Return points (n, 2) of a frame at `pose` (3,) in the frame of the pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return points @ np.array([[c, s], [-s, c]]) + pose[:2]
