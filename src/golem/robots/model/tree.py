"""The links of the robot as a tree of frames: how each stands in its parent at given joints, as /tf tells it.

Equal to the tree of the URDF export, with `base_link` above its root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.robots.model import magpie_model
from golem.robots.model.spatial import skew, transform
from golem.robots.model.table import BASE_LINK, FRAMES, JOINTS, T_TORSO_HEAD_OPTICAL
from golem.types import NUM_JOINTS, SIDES, Array


@dataclass(frozen=True, slots=True)
class Edge:
    """One frame in another, with its (4, 4) pose, at zero angle where a hinge is between them."""

    parent: str
    child: str
    T_parent_child: Array


@dataclass(frozen=True, slots=True)
class Hinge(Edge):
    """A link on a hinge, whose `axis` is a (3,) unit vector in the child."""

    joint: str
    axis: Array


def _fingers() -> list[Hinge]:
    """Return the cranks and fingers of both hands: by hand, by finger, the crank first."""
    out: list[Hinge] = []
    for side in SIDES:
        for finger in magpie_model.FINGERS:
            crank, blade, _ = magpie_model.finger_names(side, finger)
            axis = np.array([1.0 if finger == "a" else -1.0, 0.0, 0.0])
            pivot, tip = (magpie_model.mirror(finger, p) for p in (magpie_model.CRANK_PIVOT, magpie_model.FINGER_PIVOT))
            out.append(Hinge(magpie_model.hand_name(side), crank, transform(pivot), crank + "_joint", axis))
            out.append(Hinge(crank, blade, transform(tip), blade + "_joint", axis))
    return out


HINGES: tuple[Hinge, ...] = (*(Hinge(j.parent, j.child, j.T_parent_joint, j.name, j.axis) for j in JOINTS), *_fingers())
"""Every hinge: the 27 joints in motor order, then the fingers."""
FIXED: tuple[Edge, ...] = (
    Edge("base_link", BASE_LINK, np.eye(4)),
    *(Edge(f.parent, f.name, f.T_parent_frame) for f in FRAMES.values()),
    Edge("torso_link", "head_camera_optical", T_TORSO_HEAD_OPTICAL),
    *(
        edge
        for side in SIDES
        for edge in (
            Edge(f"{side}_wrist_yaw_link", magpie_model.hand_name(side), magpie_model.T_WRIST_HAND),
            Edge(magpie_model.hand_name(side), f"{side}_gripper", magpie_model.T_HAND_GRIPPER),
            Edge(magpie_model.hand_name(side), f"{side}_hand_camera_optical", magpie_model.T_HAND_CAMERA),
        )
    ),
)
"""Every frame that does not move in its parent."""

_T_PARENT_CHILD = np.array([h.T_parent_child for h in HINGES])
_AXIS = np.array([skew(h.axis) for h in HINGES])


def angles(q: Array, fingers: tuple[Array, Array]) -> Array:
    """Return the angle of every hinge [rad].

    Args:
        q: (27,) joint positions [rad].
        fingers: per side the (2,) distances of the pads from the hand's centre plane [m]; see `HandState`.
    """
    cranks = magpie_model.crank_from_gap(2.0 * np.concatenate(fingers))
    return np.concatenate([q[:NUM_JOINTS], np.column_stack([cranks, -cranks]).ravel()])


def poses(angle: Array) -> Array:
    """Return the (n, 4, 4) pose of every child in its parent, in the order of `HINGES`, at `angle` (n,) [rad]."""
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    T = _T_PARENT_CHILD.copy()
    # Rodrigues' formula.
    T[:, :3, :3] @= np.eye(3) + s * _AXIS + (1.0 - c) * (_AXIS @ _AXIS)
    return T
