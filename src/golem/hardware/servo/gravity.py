"""Torque that holds every joint against gravity, for a robot whose base may hang or stand at any inclination."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from golem.kernels import njit
from golem.native import Records
from golem.robots.model.imu_mount import TORSO
from golem.robots.model.leg_kernel import tree_gravity, tree_of
from golem.robots.model.pinocchio_model import build
from golem.types import GRAVITY, NUM_JOINTS, Array


@cache
def body_tree(hands: bool = True) -> Records:
    """Return the tree of all 27 joints, see `leg_kernel`, with or without the MAGPIE hands; not to be changed."""
    return tree_of(build(hands=hands, free_base=False))


@njit(cache=True, nogil=True)
def gravity_in_base(quat: Array, waist: float, out: Array) -> None:
    """Write gravity in base_link into `out` (3,) [m/s^2].

    Args:
        quat: (4,) orientation of the torso IMU, wxyz, of any length. The waist joint between it and base_link, whose
            turn about z is undone, is at `waist` [rad].
        waist: see `quat`.
        out: is filled.
    """
    w, x, y, z = quat[0], quat[1], quat[2], quat[3]
    scale = GRAVITY / (w * w + x * x + y * y + z * z)
    # Down in the torso: minus the third row of its rotation matrix.
    down_x = -2.0 * (x * z - w * y) * scale
    down_y = -2.0 * (y * z + w * x) * scale
    c, s = math.cos(waist), math.sin(waist)
    out[0] = c * down_x - s * down_y
    out[1] = s * down_x + c * down_y
    out[2] = -(w * w - x * x - y * y + z * z) * scale


class Gravity:
    """Generalised gravity of the model with fixed base, in a gravity field turned by the IMU.

    Equal to the lower 27 rows of the free-flyer's gravity vector, for less work.
    """

    def __init__(self, hands: bool = True) -> None:
        self._tree = body_tree(hands)[0]

    def torque(self, q: Array, quat: Array) -> Array:
        """Return the (27,) torque [N m] against gravity at `q` (27,) [rad], the torso's IMU being `quat` (4,) wxyz."""
        field, out = np.empty(3), np.empty(NUM_JOINTS)
        gravity_in_base(quat, float(q[TORSO]), field)
        tree_gravity(self._tree, q, field, out)
        return out
