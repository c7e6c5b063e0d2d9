"""Compiled descent of one arm to a pose; compiled at the first call, then cached on disk.

An arm is a product of exponentials (Brockett 1984): unit axes (8, 3) and points (8, 3) on them at zero joints, the
torso's first, and the pose (4, 4) of the grasp frame there, all in base_link.
"""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.robots.model.linear_kernel import cholesky, solve_cholesky
from golem.types import Array

DAMPING = 0.03
"""Damping of the least squares [m and rad mixed]."""
STEP = 0.35
"""Largest change of a joint in an iteration [rad]."""
POSITION, ROTATION = 0.001, 0.01
"""Distance [m] and angle [rad] from a pose that count as there."""
PATIENCE, PROGRESS = 8, 0.7
"""Steps in which the distance has to become as much smaller: what has hardly moved is at its limits."""


@njit(cache=True, nogil=True, error_model="numpy")
def rigid(T: Array) -> bool:
    """Return whether `T` (4, 4) is what `check_pose` lets pass."""
    for i in range(3):
        for j in range(3):
            dot = -1.0 if i == j else 0.0
            for k in range(3):
                dot += T[i, k] * T[j, k]
            if not abs(dot) <= 1e-4:
                return False
    x = T[1, 1] * T[2, 2] - T[1, 2] * T[2, 1]
    y = T[1, 2] * T[2, 0] - T[1, 0] * T[2, 2]
    z = T[1, 0] * T[2, 1] - T[1, 1] * T[2, 0]
    last = abs(T[3, 0]) + abs(T[3, 1]) + abs(T[3, 2]) + abs(T[3, 3] - 1.0)
    finite = math.isfinite(T[0, 3] + T[1, 3] + T[2, 3])
    return finite and last <= 1e-9 and T[0, 0] * x + T[0, 1] * y + T[0, 2] * z > 0.0


@njit(cache=True, nogil=True, error_model="numpy")
def _turn(R: Array, p: Array, axis: Array, point: Array, angle: float, at: Array) -> None:
    """Turn the frame `R`, `p` about an axis that it carries; `at` (2, 3) is written: the axis, and a point of it."""
    x, y, z = axis[0], axis[1], axis[2]
    s, c = math.sin(angle), math.cos(angle)
    v = 1.0 - c
    for i in range(3):
        a, b, d = R[i, 0], R[i, 1], R[i, 2]
        at[0, i] = a * x + b * y + d * z
        at[1, i] = a * point[0] + b * point[1] + d * point[2] + p[i]
        along = v * at[0, i]
        R[i, 0] = c * a + along * x + s * (b * z - d * y)
        R[i, 1] = c * b + along * y + s * (d * x - a * z)
        R[i, 2] = c * d + along * z + s * (a * y - b * x)
        p[i] = at[1, i] - R[i, 0] * point[0] - R[i, 1] * point[1] - R[i, 2] * point[2]


@njit(cache=True, nogil=True, error_model="numpy")
def logarithm(R: Array, p: Array, out: Array) -> None:
    """Write the twist (6,) that takes one second to the frame `R`, `p`: linear above angular."""
    # The quaternion by its largest part, so that half a turn is as exact as none.
    trace = R[0, 0] + R[1, 1] + R[2, 2]
    q = np.empty(4)
    i = 0
    for k in range(1, 3):
        if R[k, k] > R[i, i]:
            i = k
    if trace > R[i, i]:
        q[3] = 1.0 + trace
        for k in range(3):
            a, b = (k + 1) % 3, (k + 2) % 3
            q[k] = R[b, a] - R[a, b]
    else:
        a, b = (i + 1) % 3, (i + 2) % 3
        q[i] = 1.0 + R[i, i] - R[a, a] - R[b, b]
        q[a], q[b], q[3] = R[a, i] + R[i, a], R[b, i] + R[i, b], R[b, a] - R[a, b]
    if q[3] < 0.0:
        for k in range(4):
            q[k] = -q[k]
    sine = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2])
    angle = 2.0 * math.atan2(sine, q[3])
    scale = angle / sine if sine > 1e-12 * q[3] else 2.0 / q[3]
    x, y, z = scale * q[0], scale * q[1], scale * q[2]
    # (1 - angle / 2 cot(angle / 2)) / angle^2
    k = 1.0 / 12.0 if angle < 1e-4 else (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / (angle * angle)
    u, v, w = y * p[2] - z * p[1], z * p[0] - x * p[2], x * p[1] - y * p[0]
    out[0] = p[0] - 0.5 * u + k * (y * w - z * v)
    out[1] = p[1] - 0.5 * v + k * (z * u - x * w)
    out[2] = p[2] - 0.5 * w + k * (x * v - y * u)
    out[3], out[4], out[5] = x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def place_hand(q: Array, axes: Array, points: Array, grip: Array, here: Array, tip: Array, at: Array) -> None:
    """Write the grasp frame at `q` (8,) into `here` (3, 3) and `tip` (3,), and into `at` (8, 2, 3) axes and points."""
    R, p = np.empty((3, 3)), np.empty(3)
    for r in range(3):
        p[r] = 0.0
        for k in range(3):
            R[r, k] = 1.0 if r == k else 0.0
    for j in range(len(q)):
        _turn(R, p, axes[j], points[j], q[j], at[j])
    for r in range(3):
        tip[r] = R[r, 0] * grip[0, 3] + R[r, 1] * grip[1, 3] + R[r, 2] * grip[2, 3] + p[r]
        for k in range(3):
            here[r, k] = R[r, 0] * grip[0, k] + R[r, 1] * grip[1, k] + R[r, 2] * grip[2, k]


@njit(cache=True, nogil=True, error_model="numpy")
def hand_jacobian(here: Array, tip: Array, at: Array, J: Array) -> None:
    """Write the Jacobian (6, 8) of the grasp frame in its own axes, linear above angular, where `place_hand` put it."""
    for j in range(len(at)):
        axis, point = at[j, 0], at[j, 1]
        u, v, w = tip[0] - point[0], tip[1] - point[1], tip[2] - point[2]
        x, y, z = axis[1] * w - axis[2] * v, axis[2] * u - axis[0] * w, axis[0] * v - axis[1] * u
        for r in range(3):
            J[r, j] = here[0, r] * x + here[1, r] * y + here[2, r] * z
            J[3 + r, j] = here[0, r] * axis[0] + here[1, r] * axis[1] + here[2, r] * axis[2]


@njit(cache=True, nogil=True, error_model="numpy")
def error_to(goal: Array, here: Array, tip: Array, error: Array) -> None:
    """Write the twist (6,), in the axes of the frame `here`, `tip`, that takes it to `goal` (4, 4) within a second."""
    off, gap = np.empty((3, 3)), np.empty(3)
    for r in range(3):
        gap[r] = 0.0
        for k in range(3):
            gap[r] += here[k, r] * (goal[k, 3] - tip[k])
            off[r, k] = here[0, r] * goal[0, k] + here[1, r] * goal[1, k] + here[2, r] * goal[2, k]
    logarithm(off, gap, error)


@njit(cache=True, nogil=True, error_model="numpy")
def descend(
    q: Array, goal: Array, axes: Array, points: Array, grip: Array, lower: Array, upper: Array, steps: int
) -> bool:
    """Return whether damped least squares lead from `q` to the pose `goal` (4, 4) within so many steps.

    Args:
        q: (8,) the torso, which stays, and the arm [rad]; written.
        goal: where the grasp frame is to be, in base_link.
        axes: of the joints, at zero.
        points: on the axes.
        grip: (4, 4) the grasp frame, at zero.
        lower: (7,) range of the arm [rad].
        upper: (7,) its other end.
    """
    n = len(q)
    here, tip, at = np.empty((3, 3)), np.empty(3), np.empty((n, 2, 3))
    error, A, J, step = np.empty(6), np.empty((6, 6)), np.empty((6, n)), np.empty(n)
    last = np.inf
    for i in range(steps + 1):
        place_hand(q, axes, points, grip, here, tip, at)
        error_to(goal, here, tip, error)
        distance = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        angle = math.sqrt(error[3] ** 2 + error[4] ** 2 + error[5] ** 2)
        if distance < POSITION and angle < ROTATION:
            return True
        away = distance + 0.1 * angle
        if i % PATIENCE == PATIENCE - 1:
            if away > PROGRESS * last:
                return False
            last = away
        hand_jacobian(here, tip, at, J)
        for r in range(6):
            for k in range(r + 1):
                A[r, k] = DAMPING**2 * min(1.0, away) if r == k else 0.0
                for j in range(1, n):
                    A[r, k] += J[r, j] * J[k, j]
        cholesky(A, 6)
        solve_cholesky(A, 6, error)
        most = 1e-12
        for j in range(1, n):
            step[j] = 0.0
            for r in range(6):
                step[j] += J[r, j] * error[r]
            most = max(most, abs(step[j]))
        for j in range(1, n):
            q[j] = min(max(q[j] + step[j] * min(1.0, STEP / most), lower[j - 1]), upper[j - 1])
    return False
