"""How well a robot stands: capture point and feet against where they belong, for one robot or for many at once."""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.types import GRAVITY, Array


def heading_frame(R: Array) -> Array:
    """Return the (..., 2, 2) rotation from the heading frame of `R` (..., 3, 3) into its parent frame, about z."""
    norm = np.hypot(R[..., 0, 0], R[..., 1, 0])
    c, s = R[..., 0, 0] / norm, R[..., 1, 0] / norm
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


@njit(cache=True, nogil=True)
def heading(R: Array) -> tuple[float, float]:
    """Return cosine and sine of the heading of `R` (3, 3)."""
    norm = math.hypot(R[0, 0], R[1, 0])
    return R[0, 0] / norm, R[1, 0] / norm


@njit(cache=True, nogil=True)
def stand_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array, out: Array) -> None:
    """Write what `balance_errors` returns of one robot into `out` (3,): capture point, misplacement."""
    height = max(com[2] - min(soles[0, 2], soles[1, 2]), 0.1)
    lead = math.sqrt(height / GRAVITY)
    x = com[0] + velocity[0] * lead - (soles[0, 0] + soles[1, 0]) / 2.0
    y = com[1] + velocity[1] * lead - (soles[0, 1] + soles[1, 1]) / 2.0
    c, s = heading(R)
    out[0], out[1] = c * x + s * y, c * y - s * x
    x, y = soles[0, 0] - soles[1, 0], soles[0, 1] - soles[1, 1]
    ahead, sideways = c * x + s * y - stance[0], c * y - s * x - stance[1]
    out[2] = math.sqrt(ahead * ahead + sideways * sideways)


@njit(cache=True, nogil=True)
def _all_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array, out: Array) -> None:
    for i in range(len(com)):
        stand_errors(R[i], com[i], velocity[i], soles[i], stance, out[i])


def balance_errors(R: Array, com: Array, velocity: Array, soles: Array, stance: Array) -> tuple[Array, Array]:
    """Return the capture point relative to the middle of the feet (..., 2) and the feet's misplacement (...) [m].

    The capture point is x + v sqrt(h/g) with the CoM's position x, velocity v and height h above the soles.

    Args:
        R: (..., 3, 3) rotation of base_link in a level frame.
        com: (..., 3) centre of mass in that level frame, from any origin [m].
        velocity: (..., 3) its velocity [m/s].
        soles: (..., 2, 3) centres of the left and the right sole, same frame and origin [m].
        stance: (2,) where the left sole belongs relative to the right one, x ahead, y left [m].
    """
    out = np.empty(com.shape)
    R, com, velocity, soles, stance = map(np.ascontiguousarray, (R, com, velocity, soles, stance))
    coms, velocities = com.reshape(-1, 3), velocity.reshape(-1, 3)
    _all_errors(R.reshape(-1, 3, 3), coms, velocities, soles.reshape(-1, 2, 3), stance, out.reshape(-1, 3))
    return out[..., :2], out[..., 2]
