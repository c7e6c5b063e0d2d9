"""The compiled steps of `feet`, `foot_force` and `contact`, at 500 Hz; compiled once, then cached on disk."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from golem.types import Array


@njit(cache=True, nogil=True)
def wrenches(jacobians: Array, external: Array, floor: Array) -> Array:
    """Return the (2, 6) wrench on each foot whose damped least squares fit J J^T w = J tau, damped, has.

    Args:
        jacobians: (2, 6, 6) of the soles.
        external: (2, 6) torque that the ground causes [N m].
        floor: (6,) squared damping per row.
    """
    out = np.empty((2, 6))
    for k in range(2):
        J = jacobians[k]
        A = J @ J.T
        for i in range(6):
            A[i, i] += floor[i]
        out[k] = np.linalg.solve(A, J @ external[k])
    return out


@njit(cache=True, nogil=True)
def contacts(
    force: Array,
    planted: NDArray[np.bool_],
    age: Array,
    new: NDArray[np.bool_],
    config: Array,
    dt: float,
) -> tuple[Array, Array]:
    """Take the next forces (n, 2) and return probability and weight, (n, 2) each; see `Contact.step`.

    The state of the contacts, `planted` and `age` (n, 2) and `new` (n,), is brought up to date. `config` (6,) has the
    numbers of `ContactConfig` in their order.
    """
    touch, leave, middle, width, settle, ramp = config
    probability, weight = np.zeros(force.shape), np.zeros(force.shape)
    for i in range(len(force)):
        for k in range(2):
            was = planted[i, k]
            planted[i, k] = force[i, k] > (leave if was and not new[i] else touch)
            if not planted[i, k]:
                age[i, k] = 0.0
                continue
            age[i, k] = settle + ramp if new[i] else age[i, k] + dt if was else 0.0
            probability[i, k] = 1.0 / (1.0 + math.exp((middle - force[i, k]) / width))
            weight[i, k] = probability[i, k] * min(max((age[i, k] - settle) / ramp, 0.0), 1.0)
        new[i] = False
    return probability, weight


@njit(cache=True, nogil=True)
def loads(wrench: Array, up: Array, soles: Array, rotations: Array, half: Array, thickness: float) -> Array:
    """Return the (2,) vertical force on each foot [N]; what stands on the other foot is carried by that one.

    Args:
        wrench: (2, 6) of the ground.
        up: (3,) the vertical.
        soles: (2, 3) their centres [m].
        rotations: (2, 3, 3) their rotations.
        half: (2,) half length and half width of a sole [m].
        thickness: height above the other foot from which one may stand on it [m].
    """
    force = np.empty(2)
    for k in range(2):
        force[k] = wrench[k, 0] * up[0] + wrench[k, 1] * up[1] + wrench[k, 2] * up[2]
    apart = soles[0] - soles[1]
    rise = np.dot(apart, up)
    if abs(rise) >= thickness:
        lower = 1 if rise > 0.0 else 0
        R = rotations[lower]
        x = apart[0] * R[0, 0] + apart[1] * R[1, 0] + apart[2] * R[2, 0]
        y = apart[0] * R[0, 1] + apart[1] * R[1, 1] + apart[2] * R[2, 1]
        if abs(x) < 2.0 * half[0] and abs(y) < 2.0 * half[1]:
            force[lower] += force[1 - lower]
            force[1 - lower] = 0.0
    return force


@njit(cache=True, nogil=True)
def pressed(
    wrench: Array,
    force: Array,
    weight: Array,
    omega: Array,
    soles: Array,
    rotations: Array,
    twists: Array,
    half: Array,
    config: Array,
) -> tuple[Array, Array, Array]:
    """Say where the feet press on the ground, and how the soles move there; doubt feet that turn or slide.

    Args:
        wrench: (2, 6) of the ground.
        force: (2,) vertical, of both feet.
        weight: (2,) how far each foot is believed to stand still; lessened in place.
        omega: (3,) angular rate of base_link [rad/s].
        soles: (2, 3) their centres [m].
        rotations: (2, 3, 3) their rotations.
        twists: (2, 6) of the soles relative to base_link.
        half: (2,) half length and half width of a sole [m].
        config: (3,) least force [N], turning [rad/s] and sliding [m/s] of `FeetConfig`.

    Returns:
        Centre of pressure in the foot and in base_link, velocity of the sole there, (2, 3) each.
    """
    least, turning, sliding = config
    local, points, rates = np.zeros((2, 3)), np.empty((2, 3)), np.empty((2, 3))
    lever = np.empty(3)
    for k in range(2):
        R, turn = rotations[k], twists[k, 3:]
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
            points[k, i] = soles[k, i] + lever[i]
        rates[k, 0] = twists[k, 0] + turn[1] * lever[2] - turn[2] * lever[1]
        rates[k, 1] = twists[k, 1] + turn[2] * lever[0] - turn[0] * lever[2]
        rates[k, 2] = twists[k, 2] + turn[0] * lever[1] - turn[1] * lever[0]
    x, y, z = points[0] - points[1]
    u, v, w = rates[0] - rates[1]
    u += omega[1] * z - omega[2] * y
    v += omega[2] * x - omega[0] * z
    w += omega[0] * y - omega[1] * x
    lesser = 1 if force[1] < force[0] else 0
    weight[lesser] /= 1.0 + (u * u + v * v + w * w) / sliding**2
    return local, points, rates


@njit(cache=True, nogil=True)
def in_torso(points: Array, rotations: Array, moved: Array, waist: Array) -> tuple[Array, Array]:
    """Return the centres of pressure and by how much they moved within the soles, (2, 3) each, axes of the torso.

    Args:
        points: (2, 3) centres of pressure in base_link [m].
        rotations: (2, 3, 3) of the soles in base_link.
        moved: (2, 3) by how much each moved, axes of its foot [m].
        waist: (3, 3) rotation of the torso in base_link.
    """
    shift = np.empty((2, 3))
    for k in range(2):
        shift[k] = rotations[k] @ moved[k]
    return points @ waist, shift @ waist
