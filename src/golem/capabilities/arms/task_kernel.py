"""Compiled halves of a tick of differential IK, before the program is solved and after; see `task_space`.

With r = log(T_frame^-1 T_goal) the palm's residual, d r = -Jlog6(exp(-r)) J dq exactly. Jlog6 at (v, w) has the blocks
A = I + [w]/2 + b [w]^2, twice, and C A with C = d(V(w)^-1 p)/dw, where p = V(w) v is the translation (Sola et al., A
micro Lie theory, 2018) and b = 1/|w|^2 - cot(|w|/2) / (2 |w|).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from golem.capabilities.arms.ik_kernel import error_to, hand_jacobian, place_hand
from golem.capabilities.collision.sphere_kernel import Indices, Ints, nearest_pairs
from golem.kernels import njit
from golem.robots.model.linear_kernel import cholesky
from golem.types import Array

ARM = 7
FAR = 1e30
"""No bound."""
(POSITION_WEIGHT, ROTATION_WEIGHT, PALM_GAIN, POSTURE_RATE, DAMPING, ERROR_DAMPING) = range(6)
(PALM_SPEED, PALM_TURN, SINGULAR_VALUE, CLEARANCE, COLLISION_GAIN, CUTOFF, OPTIONS) = range(6, 13)
"""Where `IkMemory.options` has which; see `TaskSpaceConfig`, and `task_space.NEAR` for the cutoff."""
LEFT_OVER, SINGULAR, LAMBDA, LIMITED, COUNT, STATES = range(6)
"""Where `IkMemory.state` has: the weighted error that is left, the damping for singularities, the whole damping of this
tick, whether a limit was in the way, and how many pairs of links are near."""


class IkMemory(NamedTuple):
    """Memory of a controller; n is 15, sides are left and right, m pairs of links at most are looked at.

    Attributes:
        options: (OPTIONS,).
        axes, points, grip: (2, 8, 3), (2, 8, 3), (2, 4, 4) of torso and arm; see `ik_kernel`.
        lower, upper, speed, rest, soft: (n,); see `TaskSpaceController`.
        q: (n,) the command state [rad].
        wanted, goal: (2,) whether a palm has a goal, and (2, 4, 4) which.
        here, tip, at: (2, 3, 3), (2, 3), (2, 8, 2, 3) the grasp frames at `q`, axes and points.
        residual: (2, 6) twist to the goal, or as far as this tick goes; linear above angular.
        J: (2, 6, 8) Jacobian of a palm that has a goal, in its own axes.
        room: (n,) how far the joints may move in this tick [rad].
        H, f: (n, n), (n,) of the program.
        below, above: (n + m,) bounds of steps, then of the rows `gradient`.
        error: (2, 2) what is left of position [m] and rotation [rad] of each side.
        state: (STATES,).
        ints, floats, body: spheres, see `sphere_kernel`; empty where none is looked at.
        distance, gradient, spheres: (m,), (m, n), (m, 2) the nearest pairs, nearest first.
    """

    options: Array
    axes: Array
    points: Array
    grip: Array
    lower: Array
    upper: Array
    speed: Array
    rest: Array
    soft: Array
    q: Array
    wanted: Indices
    goal: Array
    here: Array
    tip: Array
    at: Array
    residual: Array
    J: Array
    room: Array
    H: Array
    f: Array
    below: Array
    above: Array
    error: Array
    state: Array
    ints: Ints
    floats: Array
    body: Indices
    distance: Array
    gradient: Array
    spheres: Indices


@njit(cache=True, nogil=True, error_model="numpy")
def _length(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


@njit(cache=True, nogil=True, error_model="numpy")
def _skew(r: int, k: int, v: Array) -> float:
    """Return the element of the matrix whose product with x is v x x."""
    if r == k:
        return 0.0
    return v[3 - r - k] if (k - r) % 3 == 2 else -v[3 - r - k]


@njit(cache=True, nogil=True, error_model="numpy")
def log_derivative(residual: Array, A: Array, C: Array) -> None:
    """Write the blocks A and C (3, 3) of Jlog6 at the twist -`residual` (6,)."""
    v, w, p, u = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for r in range(3):
        v[r], w[r] = -residual[r], -residual[3 + r]
    square = w[0] * w[0] + w[1] * w[1] + w[2] * w[2]
    angle = math.sqrt(square)
    if angle < 0.03:
        b = 1.0 / 12.0 + square / 720.0 + square * square / 30240.0
        slope = 1.0 / 360.0 + square / 7560.0 + square * square / 201600.0
        x, y = 0.5 - square / 24.0 + square * square / 720.0, 1.0 / 6.0 - square / 120.0 + square**2 / 5040.0
    else:
        half = 0.5 * angle
        cot, sine = math.cos(half) / math.sin(half), math.sin(half)
        b = (1.0 - half * cot) / square
        slope = (-2.0 + half * cot + half * half / (sine * sine)) / (square * square)  # (db / d|w|) / |w|
        x, y = 2.0 * sine * sine / square, (angle - math.sin(angle)) / (square * angle)
    u[0], u[1], u[2] = w[1] * v[2] - w[2] * v[1], w[2] * v[0] - w[0] * v[2], w[0] * v[1] - w[1] * v[0]
    p[0] = v[0] + x * u[0] + y * (w[1] * u[2] - w[2] * u[1])
    p[1] = v[1] + x * u[1] + y * (w[2] * u[0] - w[0] * u[2])
    p[2] = v[2] + x * u[2] + y * (w[0] * u[1] - w[1] * u[0])
    along = w[0] * p[0] + w[1] * p[1] + w[2] * p[2]
    for r in range(3):
        for k in range(3):
            one = 1.0 if r == k else 0.0
            A[r, k] = one * (1.0 - b * square) + 0.5 * _skew(r, k, w) + b * w[r] * w[k]
            C[r, k] = 0.5 * _skew(r, k, p) + b * (w[r] * p[k] + along * one - 2.0 * p[r] * w[k])
            C[r, k] += slope * (along * w[r] - square * p[r]) * w[k]


@njit(cache=True, nogil=True, error_model="numpy")
def _well_placed(J: Array, value: float) -> bool:
    """Return whether no singular value of the arm's columns of `J` (6, 8) is below `value`."""
    G = np.empty((6, 6))
    for r in range(6):
        for k in range(r + 1):
            G[r, k] = -value * value if r == k else 0.0
            for j in range(1, ARM + 1):
                G[r, k] += J[r, j] * J[k, j]
    cholesky(G, 6)
    return G[5, 5] > 0.0  # NaN where it is not positive definite


@njit(cache=True, nogil=True, error_model="numpy")
def begin(task: IkMemory, dt: float, look: bool) -> int:
    """Write the program of a tick: residuals, H, f and the bounds of the joints' steps.

    Args:
        task: whose `goal` and `wanted` are of this tick.
        dt: its length [s].
        look: whether to look out for singularities.

    Returns:
        1 where the left arm is nearer to one than is liked, 2 for the right one, 3 for both.
    """
    o, state, n = task.options, task.state, len(task.q)
    near, limited, share = 0, 0.0, min(1.0, o[POSTURE_RATE] * dt)
    if look:
        state[SINGULAR] = 0.0
    state[LAMBDA] = o[DAMPING] + o[ERROR_DAMPING] * state[LEFT_OVER] + state[SINGULAR]
    for j in range(n):
        task.room[j] = task.speed[j] * dt
        task.f[j] = -(task.soft[j] * share * (task.rest[j] - task.q[j]))
        for k in range(n):
            task.H[j, k] = task.soft[j] + state[LAMBDA] if j == k else 0.0
    A, C, row = np.empty((3, 3)), np.empty((3, 3)), np.empty((6, ARM + 1))
    for s in range(2):
        if not task.wanted[s]:
            for j in range(1 + ARM * s, 1 + ARM + ARM * s):
                task.room[j] = 0.0
            continue
        residual, J = task.residual[s], task.J[s]
        error_to(task.goal[s], task.here[s], task.tip[s], residual)
        reach, turn = o[PALM_SPEED] * dt, o[PALM_TURN] * dt
        part = min(
            reach / max(_length(residual[0], residual[1], residual[2]), reach),
            turn / max(_length(residual[3], residual[4], residual[5]), turn),
        )
        if part < 1.0:
            limited = 1.0
            for r in range(6):
                residual[r] *= part
        hand_jacobian(task.here[s], task.tip[s], task.at[s], J)
        if look and o[SINGULAR_VALUE] > 0.0 and not _well_placed(J, o[SINGULAR_VALUE]):
            near += 1 + s
        log_derivative(residual, A, C)
        for j in range(ARM + 1):
            for r in range(3):
                row[3 + r, j] = A[r, 0] * J[3, j] + A[r, 1] * J[4, j] + A[r, 2] * J[5, j]
            for r in range(3):
                row[r, j] = A[r, 0] * J[0, j] + A[r, 1] * J[1, j] + A[r, 2] * J[2, j]
                row[r, j] += C[r, 0] * row[3, j] + C[r, 1] * row[4, j] + C[r, 2] * row[5, j]
        for r in range(6):
            weight = o[POSITION_WEIGHT] if r < 3 else o[ROTATION_WEIGHT]
            for j in range(ARM + 1):
                a, scaled = (0 if j == 0 else j + ARM * s), weight * row[r, j]
                task.f[a] -= o[PALM_GAIN] * residual[r] * scaled
                for k in range(ARM + 1):
                    task.H[a, 0 if k == 0 else k + ARM * s] += scaled * row[r, k]
    state[LIMITED] = limited
    for j in range(n):
        # A joint that starts outside its range comes back at its speed, and the others make up for it.
        task.below[j] = min(max(task.lower[j] - task.q[j], -task.room[j]), task.room[j])
        task.above[j] = min(max(task.upper[j] - task.q[j], -task.room[j]), task.room[j])
    return near


@njit(cache=True, nogil=True, error_model="numpy")
def place(task: IkMemory) -> None:
    """Write what follows from the command state: grasp frames, and the nearest pairs of links with their bounds."""
    o, n, q = task.options, len(task.q), np.empty(ARM + 1)
    for s in range(2):
        q[0] = task.q[0]
        for j in range(ARM):
            q[j + 1] = task.q[1 + ARM * s + j]
        place_hand(q, task.axes[s], task.points[s], task.grip[s], task.here[s], task.tip[s], task.at[s])
    if len(task.ints) > 0:
        count = nearest_pairs(
            task.q, task.ints, task.floats, task.body, o[CUTOFF], task.distance, task.gradient, task.spheres
        )
        task.state[COUNT] = count
        for i in range(count):
            task.below[n + i] = -o[COLLISION_GAIN] * max(task.distance[i] - o[CLEARANCE], 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def finish(task: IkMemory, step: Array) -> None:
    """Integrate the joint step (15,), or as much as limits allow; `step` is empty where there is none.

    Writes the command state, what follows from it, the errors that are left, and whether a limit was in the way.
    """
    n, o = len(task.q), task.options
    if task.wanted[0] or task.wanted[1]:
        if len(step) == 0:
            task.state[LIMITED] = 1.0
        for j in range(n):
            low, high, q, wish = task.below[j], task.above[j], task.q[j], 0.0
            if len(step) > 0:
                wish = step[j]
                if task.room[j] > 0.0 and (wish <= low + 1e-9 or wish >= high - 1e-9):
                    task.state[LIMITED] = 1.0
            moved = q + min(max(wish, low), high)
            task.q[j] = min(max(moved, min(task.lower[j], q)), max(task.upper[j], q))
        place(task)
    left, error = 0.0, np.empty(6)
    for s in range(2):
        task.error[0, s] = task.error[1, s] = 0.0
        if task.wanted[s]:
            tip = task.tip[s]
            error_to(task.goal[s], task.here[s], tip, error)
            task.error[0, s] = _length(
                task.goal[s, 0, 3] - tip[0], task.goal[s, 1, 3] - tip[1], task.goal[s, 2, 3] - tip[2]
            )
            task.error[1, s] = _length(error[3], error[4], error[5])
            left += o[POSITION_WEIGHT] * task.error[0, s] ** 2 + o[ROTATION_WEIGHT] * task.error[1, s] ** 2
    task.state[LEFT_OVER] = math.sqrt(left)
