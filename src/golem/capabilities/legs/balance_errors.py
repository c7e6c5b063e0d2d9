"""How well a robot stands: capture point and feet against where they belong, for one robot or for many at once."""

from __future__ import annotations

import numpy as np

from golem.types import GRAVITY, Array


def heading_frame(R: Array) -> Array:
    """Return the (..., 2, 2) rotation from the heading frame of `R` (..., 3, 3) into its parent frame, about z."""
    norm = np.hypot(R[..., 0, 0], R[..., 1, 0])
    c, s = R[..., 0, 0] / norm, R[..., 1, 0] / norm
    return np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)


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
    height = np.maximum(com[..., 2] - soles[..., 2].min(axis=-1), 0.1)
    point = com[..., :2] + velocity[..., :2] * np.sqrt(height / GRAVITY)[..., None]
    heading = heading_frame(R)
    capture = np.einsum("...ji,...j->...i", heading, point - soles[..., :2].mean(axis=-2))
    apart = np.einsum("...ji,...j->...i", heading, soles[..., 0, :2] - soles[..., 1, :2])
    return capture, np.linalg.norm(apart - stance, axis=-1)
