"""The compiled steps of the invariant filter, at 500 Hz; compiled once, then cached on disk.

State and covariance are changed in place. The order of the error, the equations and their source: see `invariant_ekf`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.native import Record
from golem.robots.model.linear_kernel import cholesky, solve_cholesky
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
def predict(m: Record, gyro: Array, acc: Array, weight: Array, dt: float) -> None:
    """Advance the `INVARIANT` `m` by one IMU sample; see `InvariantFilter.predict`."""
    R, x, bias, P = m.R, m.x, m.bias, m.P
    contact = np.empty(2)
    for k in range(2):
        contact[k] = m.contact_noise / max(weight[k], m.numbers[0])
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
    _carry(P, enter, dt)
    for i in range(15):
        for j in range(15):
            for k in range(6):
                P[i, j] += enter[i, k] * m.noise[k // 3] * dt * enter[j, k]
    for i in range(SIZE):
        P[i, i] += (contact[(i - 9) // 3] if 9 <= i < 15 else m.wander[i]) * dt

    turn, force = np.empty(3), np.empty(3)
    for i in range(3):
        force[i] = acc[i] - bias[1, i]
        turn[i] = (gyro[i] - bias[0, i]) * dt
    for i in range(3):
        a = R[i, 0] * force[0] + R[i, 1] * force[1] + R[i, 2] * force[2] - (GRAVITY if i == 2 else 0.0)
        x[1, i] += x[0, i] * dt + 0.5 * dt * dt * a
        x[0, i] += a * dt
    product(R.copy(), exp_and_jacobian(turn)[0], R)


@njit(cache=True, nogil=True)
def product(A: Array, B: Array, out: Array) -> None:
    """Write A B, (3, 3) each, into `out`, which is neither."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[0, j] + A[i, 1] * B[1, j] + A[i, 2] * B[2, j]


@njit(cache=True, nogil=True)
def _carry(P: Array, enter: Array, dt: float) -> None:
    """Replace P by F P F^T, where F carries the error from one sample to the next.

    Beside ones on its diagonal F has gravity (rotation into velocity), `dt` (velocity into position) and -`enter` dt
    (biases into all but themselves). What a row takes from others is what they were, so those come first.
    """
    for j in range(SIZE):
        for i in range(3):
            P[6 + i, j] += dt * P[3 + i, j]
        P[3, j] += GRAVITY * dt * P[1, j]
        P[4, j] -= GRAVITY * dt * P[0, j]
        for i in range(15):
            for k in range(6):
                P[i, j] -= dt * enter[i, k] * P[15 + k, j]
    for i in range(SIZE):
        for j in range(3):
            P[i, 6 + j] += dt * P[i, 3 + j]
        P[i, 3] += GRAVITY * dt * P[i, 1]
        P[i, 4] -= GRAVITY * dt * P[i, 0]
        for j in range(15):
            for k in range(6):
                P[i, j] -= dt * enter[j, k] * P[i, 15 + k]


@njit(cache=True, nogil=True)
def correct(R: Array, x: Array, bias: Array, delta: Array) -> None:
    """Apply the invariant correction `delta` (21,) to a state."""
    turn, jacobian = exp_and_jacobian(delta)
    product(turn, R.copy(), R)
    row = np.empty(3)
    for k in range(4):
        for i in range(3):
            row[i] = x[k, i]
        for i in range(3):
            total = 0.0
            for j in range(3):
                total += turn[i, j] * row[j] + jacobian[i, j] * delta[3 + 3 * k + j]
            x[k, i] = total
    for i in range(3):
        bias[0, i] += delta[15 + i]
        bias[1, i] += delta[18 + i]


@njit(cache=True, nogil=True)
def update(m: Record, points: Array, weight: Array, shift: Array, heading: float, hanging: bool) -> NDArray[np.bool_]:
    """Fuse where the feet are seen, and the heading, into the `INVARIANT` `m`; see `InvariantFilter.update`."""
    R, x, P, planted, config = m.R, m.x, m.P, m.planted, m.numbers
    least, foot, course, rest = config[0], config[1], config[2], config[3]
    gate, reject = config[4], config[5]
    seen, off, S = np.empty((2, 3)), np.empty(3), np.empty((10, 10))
    for k in range(2):
        for i in range(3):
            seen[k, i] = R[i, 0] * points[k, 0] + R[i, 1] * points[k, 1] + R[i, 2] * points[k, 2]
            x[2 + k, i] += R[i, 0] * shift[k, 0] + R[i, 1] * shift[k, 1] + R[i, 2] * shift[k, 2]
    # The heading, then the feet that are believed, then the velocity at rest: columns of P H^T, innovations, variances.
    PH, nu, variances = np.empty((SIZE, 10)), np.empty(10), np.empty(10)
    plus, minus = np.empty(10, np.int64), np.full(10, -1)
    plus[0], nu[0], variances[0] = 2, heading, course
    n = 1
    believed = np.zeros(2, np.bool_)
    for k in range(2):
        if weight[k] < least:
            planted[k] = 0
            continue
        d = 9 + 3 * k
        for i in range(3):
            off[i] = nu[n + i] = seen[k, i] - x[2 + k, i] + x[1, i]
            for j in range(3):
                S[i, j] = P[6 + i, 6 + j] - P[6 + i, d + j] - P[d + i, 6 + j] + P[d + i, d + j]
            S[i, i] += foot
        cholesky(S, 3)
        solve_cholesky(S, 3, off)
        distance = off[0] * nu[n] + off[1] * nu[n + 1] + off[2] * nu[n + 2]
        if not planted[k] or distance > reject:
            _plant(x, P, planted, k, seen[k], foot)
            continue
        believed[k] = True
        for i in range(3):
            plus[n], minus[n] = 6 + i, d + i
            variances[n] = foot * max(distance / gate, 1.0)
            n += 1
    if hanging:
        for i in range(3):
            plus[n], nu[n], variances[n] = 3 + i, x[0, i], rest
            n += 1
    for j in range(n):
        for i in range(SIZE):
            PH[i, j] = P[i, plus[j]] - (P[i, minus[j]] if minus[j] >= 0 else 0.0)
    for i in range(n):
        for j in range(n):
            S[i, j] = PH[plus[i], j] - (PH[minus[i], j] if minus[i] >= 0 else 0.0)
        S[i, i] += variances[i]
    cholesky(S, n)
    gain, delta = PH.copy(), np.zeros(SIZE)
    for i in range(SIZE):
        solve_cholesky(S, n, gain[i])
        for j in range(n):
            delta[i] -= gain[i, j] * nu[j]
    correct(R, x, m.bias, delta)
    for i in range(SIZE):
        for j in range(i + 1):
            for k in range(n):
                P[i, j] -= 0.5 * (gain[i, k] * PH[j, k] + gain[j, k] * PH[i, k])
            P[j, i] = P[i, j]
    return believed


@njit(cache=True, nogil=True)
def _plant(x: Array, P: Array, planted: NDArray[np.int64], k: int, seen: Array, foot: float) -> None:
    """Put contact point `k` where it is seen, `seen` (3,) from the IMU, axes of odom [m]."""
    planted[k] = 1
    d = 9 + 3 * k
    for i in range(3):
        x[2 + k, i] = x[1, i] + seen[i]
        for j in range(SIZE):
            P[d + i, j] = P[6 + i, j]
    for i in range(SIZE):
        for j in range(3):
            P[i, d + j] = P[i, 6 + j]
    for i in range(3):
        P[d + i, d + i] += foot
