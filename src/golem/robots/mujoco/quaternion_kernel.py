"""Compiled arithmetic of unit quaternions (wxyz), for what runs hundreds of times per second."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from golem.types import Array


@njit(cache=True)
def turned(q: Array, rotvec: Array) -> Array:  # pragma: no cover - compiled
    """Return the orientation (4,) after the turn `rotvec` (3,) [rad], which is given in the axes of `q` (4,)."""
    angle = math.sqrt(rotvec[0] ** 2 + rotvec[1] ** 2 + rotvec[2] ** 2)
    scale = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    c, x, y, z = math.cos(0.5 * angle), scale * rotvec[0], scale * rotvec[1], scale * rotvec[2]
    out = np.empty(4)
    out[0] = q[0] * c - q[1] * x - q[2] * y - q[3] * z
    out[1] = q[0] * x + q[1] * c + q[2] * z - q[3] * y
    out[2] = q[0] * y - q[1] * z + q[2] * c + q[3] * x
    out[3] = q[0] * z + q[1] * y - q[2] * x + q[3] * c
    return out


@njit(cache=True)
def turn(p: Array, q: Array) -> Array:  # pragma: no cover - compiled
    """Return the turn (3,) [rad] that takes orientation `p` (4,) to `q` (4,), in the axes of `p`."""
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    v = np.empty(3)
    v[0] = p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2]
    v[1] = p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1]
    v[2] = p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0]
    if w < 0.0:
        w, v = -w, -v
    size = math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    return v * (2.0 if size < 1e-12 else 2.0 * math.atan2(size, w) / size)


@njit(cache=True)
def matrix(q: Array) -> Array:  # pragma: no cover - compiled
    """Return the (3, 3) rotation of an orientation `q` (4,)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return R
