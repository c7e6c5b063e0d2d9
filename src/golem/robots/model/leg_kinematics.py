"""Forward kinematics of both legs in plain numpy, for one robot or for many at once."""

from __future__ import annotations

import numpy as np

from golem.robots.model.table import JOINTS, SOLE
from golem.types import LEGS, Array

SOLE_CENTER: Array = np.array([0.5 * (SOLE.x[0] + SOLE.x[1]), 0.5 * (SOLE.y[0] + SOLE.y[1]), SOLE.z])
"""(3,) centre of the sole in its ankle_roll frame [m]."""
_ROWS = JOINTS[LEGS]
_OFFSETS: Array = np.array([joint.T_parent_joint[:3, 3] for joint in _ROWS]).reshape(2, 6, 3)
# The two columns of a rotation matrix that a turn about x, y or z mixes.
_MIXED = tuple((int(np.argmax(joint.axis)) + 1) % 3 for joint in _ROWS[:6])


def leg_poses(q: Array) -> tuple[Array, Array]:
    """Return position (..., 2, 3) [m], rotation (..., 2, 3, 3) of both ankle_roll links in base_link, `q` (..., 12)."""
    angles = q.reshape(*q.shape[:-1], 2, 6)
    c, s = np.cos(angles)[..., None], np.sin(angles)[..., None]
    R = np.zeros((*angles.shape[:-1], 3, 3))
    R[..., :, :] = np.eye(3)
    p = np.zeros((*angles.shape[:-1], 3))
    for k, a in enumerate(_MIXED):
        b = (a + 1) % 3
        p = p + np.einsum("...ij,...j->...i", R, _OFFSETS[:, k])
        first, second = R[..., a].copy(), R[..., b].copy()
        R[..., a] = c[..., k, :] * first + s[..., k, :] * second
        R[..., b] = c[..., k, :] * second - s[..., k, :] * first
    return p, R


def sole_centers(p: Array, R: Array) -> Array:
    """Return the (..., 2, 3) centres of the soles, in the frame in which `p` and `R` of `leg_poses` are given [m]."""
    return p + R @ SOLE_CENTER
