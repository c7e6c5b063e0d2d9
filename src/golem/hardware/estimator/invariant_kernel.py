"""The compiled steps of the invariant filter, at 500 Hz; compiled once, then cached on disk.

State and covariance are changed in place. The order of the error, the equations and their source: see `invariant`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from golem.types import GRAVITY, Array

SIZE = 21
"""Numbers of the error."""


@njit(cache=True, nogil=True)
def exp_and_jacobian(phi: Array) -> tuple[Array, Array]:
    """Return the rotation exp(phi) and the left Jacobian of SO(3) at `phi` (3,) [rad], (3, 3) each."""
    x, y, z = phi[0], phi[1], phi[2]
    square = x * x + y * y + z * z
    angle = math.sqrt(square)
    if angle < 1e-6:
        a, b, c = 1.0, 0.5, 1.0 / 6.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / square
        c = (1.0 - a) / square
    return _series(x, y, z, square, a, b), _series(x, y, z, square, b, c)


@njit(cache=True, nogil=True)
def _series(x: float, y: float, z: float, square: float, a: float, b: float) -> Array:
    """Return I + a K + b K K, (3, 3), where K is the cross product with (x, y, z)."""
    out = np.empty((3, 3))
    out[0, 0], out[0, 1], out[0, 2] = 1.0 + b * (x * x - square), b * x * y - a * z, b * x * z + a * y
    out[1, 0], out[1, 1], out[1, 2] = b * x * y + a * z, 1.0 + b * (y * y - square), b * y * z - a * x
    out[2, 0], out[2, 1], out[2, 2] = b * x * z - a * y, b * y * z + a * x, 1.0 + b * (z * z - square)
    return out


@njit(cache=True, nogil=True)
def predict(
    R: Array,
    x: Array,
    bias: Array,
    P: Array,
    noise: Array,
    wander: Array,
    contact: Array,
    gyro: Array,
    acc: Array,
    dt: float,
) -> None:
    """Advance by one IMU sample.

    `R`, `x`, `bias` and `P` are those of `InvariantFilter`; `gyro`, `acc` and `dt` those of its `predict`. `noise` (2,)
    are the squared densities of gyro and accelerometer, `wander` (21,) is the variance that each number of the error
    gains per second, `contact` (2,) that of the left and the right contact point.
    """
    # How errors of gyro (first three columns) and accelerometer enter the invariant error.
    enter = np.zeros((15, 6))
    for j in range(3):
        for i in range(3):
            enter[i, j] = enter[3 + i, 3 + j] = R[i, j]
        for k in range(4):
            u, v, w = x[k, 0], x[k, 1], x[k, 2]
            enter[3 + 3 * k, j] = v * R[2, j] - w * R[1, j]
            enter[4 + 3 * k, j] = w * R[0, j] - u * R[2, j]
            enter[5 + 3 * k, j] = u * R[1, j] - v * R[0, j]
    F = np.eye(SIZE)
    F[3, 1], F[4, 0] = GRAVITY * dt, -GRAVITY * dt
    for i in range(3):
        F[6 + i, 3 + i] = dt
    for i in range(15):
        for j in range(6):
            F[i, 15 + j] = -dt * enter[i, j]
    P[:] = F @ P @ F.T
    scaled = enter.copy()
    for i in range(15):
        for j in range(6):
            scaled[i, j] *= noise[j // 3] * dt
    P[:15, :15] += scaled @ enter.T
    for i in range(SIZE):
        P[i, i] += (contact[(i - 9) // 3] if 9 <= i < 15 else wander[i]) * dt

    a = R @ (acc - bias[1])
    a[2] -= GRAVITY
    for i in range(3):
        x[1, i] += x[0, i] * dt + 0.5 * dt * dt * a[i]
        x[0, i] += a[i] * dt
    R[:] = R @ exp_and_jacobian((gyro - bias[0]) * dt)[0]


@njit(cache=True, nogil=True)
def correct(R: Array, x: Array, bias: Array, delta: Array) -> None:
    """Apply the invariant correction `delta` (21,) to a state."""
    turn, jacobian = exp_and_jacobian(delta[:3])
    R[:] = turn @ R
    x[:] = x @ turn.T + np.ascontiguousarray(delta[3:15]).reshape(4, 3) @ jacobian.T
    for i in range(3):
        bias[0, i] += delta[15 + i]
        bias[1, i] += delta[18 + i]


@njit(cache=True, nogil=True)
def update(
    R: Array,
    x: Array,
    bias: Array,
    P: Array,
    planted: NDArray[np.bool_],
    points: Array,
    weight: Array,
    shift: Array,
    heading: float,
    hanging: bool,
    config: Array,
) -> NDArray[np.bool_]:
    """Fuse where the feet are seen, and the heading.

    The first five are those of `InvariantFilter`, the next five those of its `update`, which returns the same. `config`
    (6,) has the least weight, the variances of a foot, of the heading and of the rest, gate and rejection.
    """
    least, foot, course, rest, gate, reject = config
    seen = points @ R.T
    x[2:] += shift @ R.T
    # The heading, then the feet that are believed, then the velocity at rest: columns of P H^T, innovations, variances.
    PH, nu, variances = np.empty((SIZE, 10)), np.empty(10), np.empty(10)
    plus, minus = np.empty(10, np.int64), np.full(10, -1)
    plus[0], nu[0], variances[0] = 2, heading, course
    n = 1
    believed = np.zeros(2, np.bool_)
    for k in range(2):
        if weight[k] < least:
            planted[k] = False
            continue
        d = 9 + 3 * k
        off = seen[k] - x[2 + k] + x[1]
        S = P[6:9, 6:9] - P[6:9, d : d + 3] - P[d : d + 3, 6:9] + P[d : d + 3, d : d + 3] + foot * np.eye(3)
        distance = np.dot(off, np.linalg.solve(S, off))
        if not planted[k] or distance > reject:
            _plant(x, P, planted, k, seen[k], foot)
            continue
        believed[k] = True
        for i in range(3):
            plus[n], minus[n], nu[n] = 6 + i, d + i, off[i]
            variances[n] = foot * max(distance / gate, 1.0)
            n += 1
    if hanging:
        for i in range(3):
            plus[n], nu[n], variances[n] = 3 + i, x[0, i], rest
            n += 1
    S = np.empty((n, n))
    for j in range(n):
        for i in range(SIZE):
            PH[i, j] = P[i, plus[j]] - (P[i, minus[j]] if minus[j] >= 0 else 0.0)
    for i in range(n):
        for j in range(n):
            S[i, j] = PH[plus[i], j] - (PH[minus[i], j] if minus[i] >= 0 else 0.0)
        S[i, i] += variances[i]
    used = np.ascontiguousarray(PH[:, :n])
    gain = np.linalg.solve(S, np.ascontiguousarray(used.T))
    correct(R, x, bias, -(nu[:n] @ gain))
    P -= gain.T @ used.T
    for i in range(SIZE):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])
    return believed


@njit(cache=True, nogil=True)
def _plant(x: Array, P: Array, planted: NDArray[np.bool_], k: int, seen: Array, foot: float) -> None:
    """Put contact point `k` where it is seen, `seen` (3,) from the IMU, axes of odom [m]."""
    planted[k] = True
    x[2 + k] = x[1] + seen
    d = 9 + 3 * k
    P[d : d + 3] = P[6:9]
    P[:, d : d + 3] = P[:, 6:9]
    for i in range(3):
        P[d + i, d + i] += foot
