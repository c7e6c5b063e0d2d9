"""Out of a posture in which the robot touches itself, by a short motion of torso and arms."""

from __future__ import annotations

import numpy as np

from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.planning.joint_space import JointSpace
from golem.capabilities.planning.plan_kernel import ITSELF
from golem.types import Array

ROOM = 0.002
"""Distance that links get from each other [m]."""
PAIRS = 8
"""Pairs of links that are brought apart at a time."""
ROUNDS = 40
FARTHEST = 0.3
"""How far a joint may turn [rad]: more than hands that lean on the thighs need."""


def apart(space: JointSpace, model: CollisionModel, q: Array) -> Array | None:
    """Return joints (15,) near `q` at which the robot does not touch itself; None where that takes too much [rad].

    Each pair of links in turn moves along the gradient of its distance (Kaczmarz' method), until all have `ROOM`.
    """
    out = np.ascontiguousarray(q, float).copy()
    for _ in range(ROUNDS):
        if space.verdict(out) != ITSELF:
            return out
        near = model.nearest(out, PAIRS, ROOM)
        for distance, gradient in zip(near.distance, near.gradient, strict=True):
            steepness = float(gradient @ gradient)
            if steepness > 0.0:
                out += (ROOM - distance) / steepness * gradient
        out = np.clip(out, space.space.lower, space.space.upper)
        if np.abs(out - q).max() > FARTHEST:
            return None
    return None
