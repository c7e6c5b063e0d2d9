"""Where the links of a tree are, and trees with some joints held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from golem.errors import unknown_name
from golem.robots.model.link_geometry import LinkGeometry
from golem.types import Array


def joint_names(links: Sequence[LinkGeometry]) -> list[str]:
    """Return the names of the joints that move, in the order of the links."""
    return [link.joint for link in links if link.kind != "fixed"]


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


def link_poses(links: Sequence[LinkGeometry], q: Array) -> Array:
    """Return the (n, 4, 4) poses of the links in the base.

    Args:
        links: parents before children.
        q: one position per joint of `joint_names` [rad or m].
    """
    poses = np.empty((len(links), 4, 4))
    column = 0
    for i, link in enumerate(links):
        value = 0.0
        if link.kind != "fixed":
            value = float(q[column])
            column += 1
        local = joint_pose(link, value)
        poses[i] = local if link.parent < 0 else poses[link.parent] @ local
    return poses


def hold_joints(links: Sequence[LinkGeometry], held: Mapping[str, float]) -> tuple[LinkGeometry, ...]:
    """Return the links with some joints fixed at a position [rad or m].

    Raises:
        ConfigError: no link hangs on a joint of that name.
    """
    names = joint_names(links)
    for name in held:
        if name not in names:
            raise unknown_name("joint", name, names)
    return tuple(
        replace(link, kind="fixed", joint="", T_parent_link=joint_pose(link, held[link.joint]))
        if link.joint in held and link.kind != "fixed"
        else link
        for link in links
    )


def body_of(links: Sequence[LinkGeometry]) -> list[int]:
    """Return for each link the first of the links that move as one with it."""
    bodies: list[int] = []
    for i, link in enumerate(links):
        bodies.append(bodies[link.parent] if link.kind == "fixed" and link.parent >= 0 else i)
    return bodies


def neighbours(links: Sequence[LinkGeometry]) -> set[tuple[int, int]]:
    """Return the pairs (i, j), i < j, of links that move as one or hang on each other by one joint.

    Links without a surface, such as those between the joints of a ball, count as part of the joint.
    """
    body = body_of(links)
    solid = {body[i] for i, link in enumerate(links) if link.parts}

    def above(b: int) -> int:
        while True:
            parent = links[b].parent
            if parent < 0:
                return -1
            b = body[parent]
            if b in solid:
                return b

    parents = {b: above(b) for b in set(body)}
    return {
        (i, j)
        for j in range(len(links))
        for i in range(j)
        if body[i] == body[j] or parents[body[i]] == body[j] or parents[body[j]] == body[i]
    }
