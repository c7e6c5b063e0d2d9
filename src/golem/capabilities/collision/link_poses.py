"""Where the links of a tree are, and trees with some joints held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from golem.errors import unknown_name
from golem.robots.model.link_geometry import LinkGeometry, joint_pose
from golem.types import Array


def free_links(links: Sequence[LinkGeometry]) -> list[LinkGeometry]:
    """Return the links whose joints move and follow no other, in order."""
    return [link for link in links if link.kind != "fixed" and not link.leader]


def joint_names(links: Sequence[LinkGeometry]) -> list[str]:
    """Return the names of the joints that move by themselves, in the order of the links."""
    return [link.joint for link in free_links(links)]


def joint_value(link: LinkGeometry, q: Mapping[str, float]) -> float:
    """Return the position of a link's joint [rad or m] where the free joints are at `q`; those not named are at 0."""
    if link.leader:
        return link.ratio * q.get(link.leader, 0.0) + link.offset
    return q.get(link.joint, 0.0)


def link_poses(links: Sequence[LinkGeometry], q: Array) -> Array:
    """Return the (n, 4, 4) poses of the links in the base.

    Args:
        links: parents before children.
        q: one position per joint of `joint_names` [rad or m].
    """
    poses = np.empty((len(links), 4, 4))
    values = dict(zip(joint_names(links), (float(v) for v in q), strict=True))
    for i, link in enumerate(links):
        local = joint_pose(link, joint_value(link, values))
        poses[i] = local if link.parent < 0 else poses[link.parent] @ local
    return poses


def hold_joints(links: Sequence[LinkGeometry], held: Mapping[str, float]) -> tuple[LinkGeometry, ...]:
    """Return the links with some joints, and those that follow them, fixed at a position [rad or m].

    Raises:
        ConfigError: no link hangs on a joint of that name.
    """
    names = joint_names(links)
    for name in held:
        if name not in names:
            raise unknown_name("joint", name, names)
    return tuple(
        replace(link, kind="fixed", joint="", leader="", T_parent_link=joint_pose(link, joint_value(link, held)))
        if (link.leader or link.joint) in held and link.kind != "fixed"
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
