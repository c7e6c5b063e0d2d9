"""Poses of a hand that are found from another one, and places on the floor."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from golem.errors import ConfigError
from golem.types import Array


def floor_places(what: str, numbers: Sequence[float]) -> Array:
    """Return (n, 2) the places that `numbers` name, x and y of each [m], in the goal that an error calls `what`.

    Raises ConfigError: they are no pairs, or not finite.
    """
    if len(numbers) % 2 or not all(map(math.isfinite, numbers)):
        raise ConfigError(f"The places of {what} are pairs of finite numbers, x and y of each place.")
    return np.array(numbers, float).reshape(-1, 2)


def stands_at(position: Array, places: Array, within: float) -> bool:
    """Return whether `position` (2,) or (3,) is, over the floor, less than `within` [m] from one of `places` (n, 2)."""
    return bool((np.linalg.norm(places - position[:2], axis=1) < within).any())


def counts_at(position: Array, places: Array, within: float) -> bool:
    """Return whether a thing there counts: it `stands_at` one of the `places`, or none is named."""
    return not len(places) or stands_at(position, places, within)


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


def share_off(T: Array, place: Array, off: Array) -> tuple[float, float]:
    """Return what a head camera is off by, as a share of a thing's distance, outwards and to the left of the robot.

    Args:
        T: (4, 4) pose of base_link in odom.
        place: (2,) or (3,) where the thing is in odom [m].
        off: (2,) how far that is from where the camera had it, in odom [m].
    """
    R = T[:2, :2].T
    share = complex(*(R @ off)) / complex(*(R @ (place[:2] - off - T[:2, 3])))
    return share.real, share.imag


def head_off(T: Array, place: Array, share: Sequence[float]) -> Array:
    """Return how far (2,) in odom a thing is from where the head camera has it, at `place` [m]; see `share_off`."""
    R = T[:2, :2]
    off = complex(*(R.T @ (place[:2] - T[:2, 3]))) * complex(*share)
    return R @ (off.real, off.imag)
