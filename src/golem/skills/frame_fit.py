"""How two frames on the floor lie to each other, by places that are known in both."""

from __future__ import annotations

import math

import numpy as np

from golem.types import Array, PlanarPose


def fit_frames(a: Array, b: Array) -> tuple[PlanarPose, float]:
    """Return where the frame of `a` is in that of `b`, and the RMS distance that is left [m].

    Least squares over turn and shift, as Kabsch (Acta Cryst. A32, 1976), for frames whose z axes are parallel.

    Args:
        a: (n, 2) places, n >= 1; of one alone follows no turn [m].
        b: (n, 2) the same in the other frame [m].
    """
    mid_a, mid_b = a.mean(axis=0), b.mean(axis=0)
    p, q = a - mid_a, b - mid_b
    turn = math.atan2(float(np.sum(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0])), float(np.sum(p * q)))
    R = PlanarPose(0.0, 0.0, turn).matrix()[:2, :2]
    left = a @ R.T + (mid_b - R @ mid_a) - b
    x, y = (mid_b - R @ mid_a).tolist()
    return PlanarPose(x, y, turn), float(np.sqrt(np.mean(np.sum(left**2, axis=1))))


def matched(known: Array, seen: Array, within: float) -> tuple[Array, Array]:
    """Return the pairs (k, 2), (k, 2) of `known` (n, 2) and `seen` (m, 2) places that are nearest to each other."""
    if not len(known) or not len(seen):
        return np.zeros((0, 2)), np.zeros((0, 2))
    away = np.linalg.norm(known[:, None] - seen[None], axis=2)
    mine, other = away.argmin(axis=0), away.argmin(axis=1)
    good = [k for k in range(len(seen)) if other[mine[k]] == k and away[mine[k], k] < within]
    return known[mine[good]], seen[good]
