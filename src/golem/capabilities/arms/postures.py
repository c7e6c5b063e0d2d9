"""Named upper-body postures: where an arm waits, and where it starts to work; and hands that point down."""

from __future__ import annotations

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS, NUM_UPPER
from golem.errors import unknown_name
from golem.types import Array

_MIRROR = np.array([1.0, -1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
# Right arm, motor order [rad], torso ahead, hand straight down, gripper's x axis towards -y (so that the fingers close
# along x). tests/capabilities/arms/test_postures.py solves them again.
_HOME = np.array([-2.2676, -1.0230, -0.0531, 2.8722, -2.1033, -0.2992, 0.9781])
_READY = np.array([-2.1677, -0.3555, -0.0472, 2.9261, -1.4805, -0.1529, 0.8282])

# Right arm with the hand at (0.45, -0.22, 0.15) in base_link, looking straight ahead, its x axis down.
_FORWARD = np.array([0.0462, -0.4472, 0.5271, -0.3920, 0.3609, 0.1077, -0.6154])


def _both(left: Array, right: Array) -> Array:
    return np.concatenate([[0.0], _MIRROR * left, right])


POSTURES: dict[str, Array] = {
    "home": _both(_HOME, _HOME),
    "ready": _both(_READY, _READY),
    "ready_left": _both(_READY, _HOME),
    "ready_right": _both(_HOME, _READY),
    "forward": _both(_FORWARD, _FORWARD),
    "forward_left": _both(_FORWARD, _HOME),
    "forward_right": _both(_HOME, _FORWARD),
}
"""Joints (15,) by name. `home`: grasp frames at (0.36, -+0.44, 0.25) in base_link, outside the head camera's view.
`ready`: above the work area, at (0.43, -+0.22, 0.20), where margin to the limits and manipulability are best and from
where the whole area is reached without changing the arm's configuration; one arm or both. `forward`: before a door or
a shelf, hands at (0.45, -+0.22, 0.15) that look straight ahead."""


def posture(name: str) -> Array:
    """Return a copy of the (15,) joints of a named posture [rad]. Raises ConfigError: there is no such posture."""
    if name not in POSTURES:
        raise unknown_name("posture", name, POSTURES)
    return POSTURES[name].copy()


def mirror(q: Array) -> Array:
    """Return `q` (15,) [rad] seen in the x-z plane: left and right exchanged, rolls and yaws negated."""
    out = np.empty(NUM_UPPER)
    out[0] = -q[0]
    out[ARM_COLUMNS["left"]] = _MIRROR * q[ARM_COLUMNS["right"]]
    out[ARM_COLUMNS["right"]] = _MIRROR * q[ARM_COLUMNS["left"]]
    return out


def downward(x: float, y: float, z: float, heading: float) -> Array:
    """Return the (4, 4) pose of a grasp frame that points straight down.

    Args:
        x: forward position of its origin in base_link [m].
        y: its position to the left [m].
        z: its height [m].
        heading: direction of its x axis in the horizontal plane, from base_link's x axis [rad].
    """
    c, s = np.cos(heading), np.sin(heading)
    return np.array([[c, s, 0.0, x], [s, -c, 0.0, y], [0.0, 0.0, -1.0, z], [0.0, 0.0, 0.0, 1.0]])
