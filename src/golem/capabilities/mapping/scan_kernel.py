"""Compiled steps of posing a scan; compiled once, then cached on disk."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.types import Array


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
