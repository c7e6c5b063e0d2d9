"""Left and right exchanged: how observations and actions change when the robot is seen in a mirror."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from golem.robots.model.table import JOINT_NAMES
from golem.types import LEGS, UPPER, Array

_FLIPPED = {
    # Components that change sign in a mirror at the xz plane.
    "base_velocity": ("y",),
    "base_rate": ("x", "z"),
    "gravity": ("y",),
    "twist": ("vy", "wz"),
}


class Mirror:
    """A permutation with signs: `mirrored = values[..., order] * sign`, (n,) each."""

    def __init__(self, components: Sequence[tuple[str, str]]) -> None:
        """Mirror vectors of `components`, each a term and the name of its component as in `Layout.components`."""
        where = {key: i for i, key in enumerate(components)}
        self.order: NDArray[np.intp] = np.array([where[term, _other(name)] for term, name in components])
        self.sign: Array = np.array([_sign(term, name) for term, name in components])

    def __call__(self, values: Array) -> Array:
        """Return `values` (..., n) as the mirrored robot has them."""
        return values[..., self.order] * self.sign


def leg_mirror() -> Mirror:
    """Return the mirror of 12 leg values."""
    return Mirror([("joint", name) for name in JOINT_NAMES[LEGS]])


def upper_mirror() -> Mirror:
    """Return the mirror of 15 upper-body values."""
    return Mirror([("joint", name) for name in JOINT_NAMES[UPPER]])


def _other(name: str) -> str:
    if name.startswith("left"):
        return "right" + name[4:]
    return "left" + name[5:] if name.startswith("right") else name


def _sign(term: str, name: str) -> float:
    turned = "_yaw" in name or "_roll" in name or name.startswith("torso")
    return -1.0 if turned or name in _FLIPPED.get(term, ()) else 1.0
