"""Compiled arithmetic of unit quaternions (wxyz), for what runs hundreds of times per second."""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.types import Array


@njit(cache=True, nogil=True, error_model="numpy")
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


@njit(cache=True, nogil=True, error_model="numpy")
def turn(p: Array, q: Array) -> Array:  # pragma: no cover - compiled
    """Return the turn (3,) [rad] that takes orientation `p` (4,) to `q` (4,), in the axes of `p`."""
    w = p[0] * q[0] + p[1] * q[1] + p[2] * q[2] + p[3] * q[3]
    v = np.empty(3)
    v[0] = p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2]
    v[1] = p[0] * q[2] + p[1] * q[3] - p[2] * q[0] - p[3] * q[1]
    v[2] = p[0] * q[3] - p[1] * q[2] + p[2] * q[1] - p[3] * q[0]
    size = math.sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2)
    scale = 2.0 if size < 1e-12 else 2.0 * math.atan2(size, abs(w)) / size
    for i in range(3):
        v[i] *= -scale if w < 0.0 else scale
    return v


@njit(cache=True, nogil=True, error_model="numpy")
def matrix(q: Array) -> Array:  # pragma: no cover - compiled
    """Return the (3, 3) rotation of an orientation `q` (4,)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R = np.empty((3, 3))
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return R


@njit(cache=True, nogil=True, error_model="numpy")
def between(
    q0: Array, rate0: Array, v0: Array, q1: Array, rate1: Array, v1: Array, arm: Array, share: float
) -> tuple[Array, Array]:  # pragma: no cover - compiled
    """Return the orientation (4,) of a body, and the velocity (3,) of a point of it, between two moments.

    `q0`, `rate0` and `v0` are orientation, angular rate in the body's axes [rad/s] and velocity of its origin [m/s] at
    one moment, `q1`, `rate1` and `v1` at the next. `arm` (3,) is the point in the body [m], `share` how far it is from
    one moment to the next.
    """
    rotvec, p0, p1 = turn(q0, q1), _point_rate(q0, rate0, v0, arm), _point_rate(q1, rate1, v1, arm)
    for i in range(3):
        rotvec[i] *= share
        p0[i] += share * (p1[i] - p0[i])
    return turned(q0, rotvec), p0


@njit(cache=True, nogil=True, error_model="numpy")
def _point_rate(q: Array, rate: Array, v: Array, arm: Array) -> Array:  # pragma: no cover - compiled
    """Return the velocity (3,) of a point of a body: v + R (rate x arm)."""
    R, out = matrix(q), np.empty(3)
    x, y, z = (
        rate[1] * arm[2] - rate[2] * arm[1],
        rate[2] * arm[0] - rate[0] * arm[2],
        rate[0] * arm[1] - rate[1] * arm[0],
    )
    for i in range(3):
        out[i] = v[i] + (R[i, 0] * x + R[i, 1] * y + R[i, 2] * z)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def sensed(
    q0: Array, v0: Array, q1: Array, v1: Array, mount: Array, gravity: Array, dt: float
) -> tuple[Array, Array]:  # pragma: no cover - compiled
    """Return the mean angular rate [rad/s] and specific force [m/s^2], (3,) each, of an IMU between two moments.

    `q0`, `v0` and `q1`, `v1` are orientation of the body and velocity of the IMU at both, `dt` the time between them
    [s], `mount` (3, 3) the IMU's axes in the body, `gravity` (3,) in the world [m/s^2].
    """
    rotvec, half = turn(q0, q1), np.empty(3)
    for i in range(3):
        half[i] = 0.5 * rotvec[i]
    R = matrix(turned(q0, half))
    body, rate, force = np.zeros(3), np.zeros(3), np.zeros(3)
    for i in range(3):
        for k in range(3):
            body[i] += R[k, i] * ((v1[k] - v0[k]) / dt - gravity[k])
    for i in range(3):
        for k in range(3):
            rate[i] += mount[k, i] * rotvec[k]
            force[i] += mount[k, i] * body[k]
        rate[i] /= dt
    return rate, force
