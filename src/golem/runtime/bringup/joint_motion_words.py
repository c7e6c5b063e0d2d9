"""Says how a joint moves in its positive direction, so that a person can move it by hand."""

from __future__ import annotations

import numpy as np

from golem.robots.model.kinematics import Kinematics
from golem.robots.model.spatial import skew
from golem.robots.model.table import JOINT_NAMES, JOINTS
from golem.types import Array

LEVER = 0.08
"""Distance from the axis from which a part visibly moves [m per rad]."""
_AHEAD = (np.array([1.0, 0.0, 0.0]), "forward", "backward")
_LEFT = (np.array([0.0, 1.0, 0.0]), "to the left", "to the right")
_UP = (np.array([0.0, 0.0, 1.0]), "up", "down")


def motion_words(joint: int, q: Array, positive: bool = True) -> str:
    """Return what a person sees when a joint turns, as seen by the robot.

    Args:
        joint: its index in motor order.
        q: (27,) joints of the robot now [rad].
        positive: whether it turns in its positive direction.

    Returns:
        E.g. "the left foot goes backward": of the parts that it moves the first that visibly does.
    """
    kinematics = Kinematics()
    kinematics.update(q)
    row = JOINTS[joint]
    T = kinematics.pose(row.child)
    axis = T[:3, :3] @ row.axis
    moves = [(name, skew(axis) @ (point - T[:3, 3])) for name, point in _parts(joint, kinematics)]
    name, move = next(
        (m for m in moves if np.linalg.norm(m[1]) >= LEVER), max(moves, key=lambda m: np.linalg.norm(m[1]))
    )
    axis, towards, away = max((_AHEAD, _LEFT, _UP), key=lambda d: abs(move @ d[0]))
    return f"{name} goes {towards if (move @ axis > 0.0) == positive else away}"


def _parts(joint: int, kinematics: Kinematics) -> list[tuple[str, Array]]:
    """Return points at the far end of the joint's limb, in base_link [m]."""
    name = JOINT_NAMES[joint]
    side = name.partition("_")[0]
    if name.startswith("torso"):
        return [("the chest", kinematics.pose("torso_link")[:3, 3] + (0.2, 0.0, 0.3))]
    leg = any(part in name for part in ("hip", "knee", "ankle"))
    if leg:
        end = kinematics.pose(f"{side}_ankle_roll_link")[:3, 3]
        return [
            (f"the {side} foot", end),
            (f"the toes of the {side} foot", end + (0.15, 0.0, -0.05)),
            (f"the left edge of the {side} foot", end + (0.0, 0.08, -0.05)),
        ]
    end = kinematics.pose(f"{side}_gripper")[:3, 3]
    return [
        (f"the {side} hand", end),
        (f"the front of the {side} hand", end + (0.1, 0.0, 0.0)),
        (f"the left of the {side} hand", end + (0.0, 0.1, 0.0)),
        (f"the top of the {side} hand", end + (0.0, 0.0, 0.1)),
    ]
