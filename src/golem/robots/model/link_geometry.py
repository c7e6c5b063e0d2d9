"""A link of a robot: its joint, its range and its surface, and where its joint puts it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from golem.types import Array

JointKind = Literal["fixed", "hinge", "slide"]


@dataclass(frozen=True, slots=True)
class SurfacePart:
    """A triangle mesh in the frame of its link: vertices (n, 3) [m], faces (m, 3)."""

    vertices: Array
    faces: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class LinkGeometry:
    """A link.

    Attributes:
        parent: index of its parent among the links, -1 for a root.
        T_parent_link: (4, 4) pose in the parent at zero angle; for a root, in the base.
        joint: name of the joint that moves it in its parent; empty when fixed.
        kind: of that joint.
        axis: (3,) unit vector of the joint in the link.
        anchor: (3,) point on a hinge's axis in the link [m].
        lower, upper: range [rad or m]; +-pi or +-1 m where the file gives none.
        parts: its surface.
        leader: name of the joint that this one follows, by a <mimic> or the like; empty where it is free.
        ratio, offset: of such a joint: its position is ratio times that of the leader, plus the offset [rad or m].
    """

    name: str
    parent: int
    T_parent_link: Array
    joint: str
    kind: JointKind
    axis: Array
    anchor: Array
    lower: float
    upper: float
    parts: tuple[SurfacePart, ...]
    leader: str = ""
    ratio: float = 1.0
    offset: float = 0.0


def joint_pose(link: LinkGeometry, q: float) -> Array:
    """Return the (4, 4) pose of a link in its parent with its joint at `q` [rad or m]."""
    T = np.eye(4)
    if link.kind == "slide":
        T[:3, 3] = q * link.axis
    elif link.kind == "hinge":
        x, y, z = link.axis
        K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        T[:3, :3] = np.eye(3) + np.sin(q) * K + (1.0 - np.cos(q)) * (K @ K)
        T[:3, 3] = link.anchor - T[:3, :3] @ link.anchor
    return link.T_parent_link @ T


def free_links(links: Sequence[LinkGeometry]) -> list[LinkGeometry]:
    """Return the links whose joints move and follow no other, in order."""
    return [link for link in links if link.kind != "fixed" and not link.leader]


def joint_names(links: Sequence[LinkGeometry]) -> list[str]:
    """Return the names of the joints that move by themselves, in the order of the links."""
    return [link.joint for link in free_links(links)]


def joint_value(link: LinkGeometry, q: Mapping[str, float]) -> float:
    """Return the position of a link's joint [rad or m] where the free joints are at `q`; those not named are at 0."""
    return link.ratio * q.get(link.leader, 0.0) + link.offset if link.leader else q.get(link.joint, 0.0)
