"""The compiled steps of `feet`, at 500 Hz; compiled once, then cached on disk.

Loops in place of array expressions: numba compiles the messages of their shape errors, too, for seconds.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.native import Record
from golem.robots.model.linear_kernel import cholesky, solve_cholesky
from golem.types import Array

_THICKNESS = 0.01
"""Height above the other foot from which one may stand on it [m]: half of what it takes. What a foot carries that
stands on the other one goes to that one, which it pins to the ground: pushed to a side, a robot that walks may cross
its legs, and the leg of the lower foot then feels no load."""


@njit(cache=True, nogil=True)
def wrenches(jacobians: Array, external: Array, floor: Array) -> Array:
    """Return the (2, 6) wrench on each foot whose damped least squares fit J J^T w = J tau, damped, has.

    Args:
        jacobians: (2, 6, 6) of the soles.
        external: (2, 6) torque that the ground causes [N m].
        floor: (6,) squared damping per row.
    """
    out, L = np.empty((2, 6)), np.empty((6, 6))
    for k in range(2):
        J, w = jacobians[k], out[k]
        for i in range(6):
            w[i] = 0.0
            for m in range(6):
                w[i] += J[i, m] * external[k, m]
            for j in range(i + 1):
                L[i, j] = floor[i] if i == j else 0.0
                for m in range(6):
                    L[i, j] += J[i, m] * J[j, m]
        cholesky(L, 6)
        solve_cholesky(L, 6, w)
    return out


@njit(cache=True, nogil=True)
def contacts(
    force: Array, planted: NDArray[np.bool_], age: Array, new: NDArray[np.bool_], config: Array, dt: float
) -> tuple[Array, Array]:
    """Take the next forces (n, 2) and return probability and weight, (n, 2) each; see `Contact.step`.

    The state of the contacts, `planted` and `age` (n, 2) and `new` (n,), is brought up to date. `config` (6,) has the
    numbers of `ContactConfig` in their order.
    """
    probability, weight = np.zeros(force.shape), np.zeros(force.shape)
    for i in range(len(force)):
        contact(force[i], planted[i], age[i], new[i], config, dt, probability[i], weight[i])
        new[i] = False
    return probability, weight


@njit(cache=True, nogil=True)
def contact(
    force: Array,
    planted: NDArray[Any],
    age: Array,
    new: bool,
    config: Array,
    dt: float,
    probability: Array,
    weight: Array,
) -> None:
    """Do what `contacts` does for one robot; all arrays are (2,), the last two are filled."""
    touch, leave, middle, width, settle, ramp = (config[0], config[1], config[2], config[3], config[4], config[5])
    for k in range(2):
        was = planted[k] != 0
        probability[k] = weight[k] = 0.0
        planted[k] = force[k] > (leave if was and not new else touch)
        if not planted[k]:
            age[k] = 0.0
            continue
        age[k] = settle + ramp if new else age[k] + dt if was else 0.0
        probability[k] = 1.0 / (1.0 + math.exp((middle - force[k]) / width))
        weight[k] = probability[k] * min(max((age[k] - settle) / ramp, 0.0), 1.0)


@njit(cache=True, nogil=True)
def loads(m: Record, wrench: Array, up: Array) -> None:
    """Write the vertical force on each foot into the `FEET` `m`; what stands on the other foot is carried by that one.

    Args:
        m: of one robot, its legs in motion.
        wrench: (2, 6) of the ground.
        up: (3,) the vertical.
    """
    force, soles, half = m.force, m.motion.soles, m.half
    for k in range(2):
        force[k] = wrench[k, 0] * up[0] + wrench[k, 1] * up[1] + wrench[k, 2] * up[2]
    u, v, w = soles[0, 0] - soles[1, 0], soles[0, 1] - soles[1, 1], soles[0, 2] - soles[1, 2]
    rise = u * up[0] + v * up[1] + w * up[2]
    if abs(rise) >= _THICKNESS:
        lower = 1 if rise > 0.0 else 0
        R = m.motion.rotations[lower]
        x = u * R[0, 0] + v * R[1, 0] + w * R[2, 0]
        y = u * R[0, 1] + v * R[1, 1] + w * R[2, 1]
        if abs(x) < 2.0 * half[0] and abs(y) < 2.0 * half[1]:
            force[lower] += force[1 - lower]
            force[1 - lower] = 0.0


@njit(cache=True, nogil=True)
def press(m: Record, wrench: Array, omega: Array) -> None:
    """Write into the `FEET` `m` where the feet press, and how the soles move there; doubt feet that turn or slide.

    Args:
        m: of one robot, with forces and weights; the weights are lessened.
        wrench: (2, 6) of the ground.
        omega: (3,) angular rate of base_link [rad/s].
    """
    least, turning, sliding = m.doubts[0], m.doubts[1], m.doubts[2]
    local, points, rates, weight, half, twists = m.local, m.points, m.rates, m.weight, m.half, m.motion.twists
    lever = np.empty(3)
    for k in range(2):
        R, turn = m.motion.rotations[k], twists[k, 3:]
        local[k, 0] = local[k, 1] = local[k, 2] = 0.0
        square = 0.0
        for i in range(3):
            square += ((turn[i] + omega[i]) / turning) ** 2
        weight[k] /= 1.0 + square
        normal = across_x = across_y = 0.0
        for i in range(3):
            normal += wrench[k, i] * R[i, 2]
            across_x += wrench[k, 3 + i] * R[i, 0]
            across_y += wrench[k, 3 + i] * R[i, 1]
        if normal >= least:
            local[k, 0] = min(max(-across_y / normal, -half[0]), half[0])
            local[k, 1] = min(max(across_x / normal, -half[1]), half[1])
        for i in range(3):
            lever[i] = R[i, 0] * local[k, 0] + R[i, 1] * local[k, 1]
            points[k, i] = m.motion.soles[k, i] + lever[i]
        rates[k, 0] = twists[k, 0] + turn[1] * lever[2] - turn[2] * lever[1]
        rates[k, 1] = twists[k, 1] + turn[2] * lever[0] - turn[0] * lever[2]
        rates[k, 2] = twists[k, 2] + turn[0] * lever[1] - turn[1] * lever[0]
    x, y, z = points[0, 0] - points[1, 0], points[0, 1] - points[1, 1], points[0, 2] - points[1, 2]
    u = rates[0, 0] - rates[1, 0] + (omega[1] * z - omega[2] * y)
    v = rates[0, 1] - rates[1, 1] + (omega[2] * x - omega[0] * z)
    w = rates[0, 2] - rates[1, 2] + (omega[0] * y - omega[1] * x)
    lesser = 1 if m.force[1] < m.force[0] else 0
    weight[lesser] /= 1.0 + (u * u + v * v + w * w) / sliding**2


@njit(cache=True, nogil=True)
def in_torso(points: Array, rotations: Array, moved: Array, waist: Array) -> tuple[Array, Array]:
    """Return the centres of pressure and by how much they moved within the soles, (2, 3) each, axes of the torso.

    Args:
        points: (2, 3) centres of pressure in base_link [m].
        rotations: (2, 3, 3) of the soles in base_link.
        moved: (2, 3) by how much each moved, axes of its foot [m].
        waist: (3, 3) rotation of the torso in base_link.
    """
    centres, shift, foot = np.zeros((2, 3)), np.zeros((2, 3)), np.empty(3)
    for k in range(2):
        R = rotations[k]
        for i in range(3):
            foot[i] = R[i, 0] * moved[k, 0] + R[i, 1] * moved[k, 1] + R[i, 2] * moved[k, 2]
        for i in range(3):
            for j in range(3):
                centres[k, i] += points[k, j] * waist[j, i]
                shift[k, i] += foot[j] * waist[j, i]
    return centres, shift
