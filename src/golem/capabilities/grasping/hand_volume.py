"""What of the MAGPIE hand is in the way of things: fingers and palm as boxes in the grasp frame, against clouds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.types import Array

FINGER = (0.012, 0.022, 0.090)
"""Half width along x, thickness along y and length along z of a finger behind its tip [m]."""
PALM = ((-0.035, 0.035), (-0.065, 0.065), (-0.200, -0.095))
"""x, y and z bounds of housing and palm camera in the grasp frame [m]."""
TOUCHING = 2
"""Points in the hand's volume from which on it collides: stray ones come alone."""


def collides(T: Array, gaps: Array, points: Array) -> NDArray[np.bool_]:
    """Return (n,) whether the open hand at each pose holds points in its own volume.

    Args:
        T: (n, 4, 4) poses of the grasp frame.
        gaps: (n,) openings [m].
        points: (m, 3) in the same frame as the poses [m].
    """
    local = in_hands(T, points)
    x, y, z = np.abs(local[..., 0]), np.abs(local[..., 1]), local[..., 2]
    half = 0.5 * gaps[:, None]
    finger = (x < FINGER[0]) & (y > half) & (y < half + FINGER[1]) & (z > -FINGER[2]) & (z < 0.0)
    palm = (x < PALM[0][1]) & (y < PALM[1][1]) & (z > PALM[2][0]) & (z < PALM[2][1])
    return (finger | palm).sum(axis=1) >= TOUCHING


def in_hands(T: Array, points: Array) -> Array:
    """Return (n, m, 3) `points` (m, 3) in each of the frames `T` (n, 4, 4)."""
    R = T[:, :3, :3]
    return points @ R - np.einsum("ni,nij->nj", T[:, :3, 3], R)[:, None]
