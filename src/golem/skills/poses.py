"""Poses of a hand that are found from another one."""

from __future__ import annotations

import numpy as np

from golem.types import Array


def lifted(T: Array, height: float) -> Array:
    """Return pose `T` (4, 4) raised by `height` [m] along odom z."""
    return at_height(T, T[2, 3] + height)


def moved(T: Array, by: Array) -> Array:
    """Return pose `T` (4, 4) moved by `by` (3,) in odom [m]."""
    there = T.copy()
    there[:3, 3] += by
    return there


def retracted(T: Array, distance: float) -> Array:
    """Return pose `T` (4, 4) moved back by `distance` [m] against its approach axis, z."""
    return moved(T, -distance * T[:3, 2])


def at_height(T: Array, z: float) -> Array:
    """Return pose `T` (4, 4) with its odom z set to `z` [m]."""
    raised = T.copy()
    raised[2, 3] = z
    return raised


def turned(T: Array, angle: float) -> Array:
    """Return a copy of pose `T` (4, 4) turned by `angle` [rad] about the vertical, where it is."""
    c, s = np.cos(angle), np.sin(angle)
    out = T.copy()
    out[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ T[:3, :3]
    return out
