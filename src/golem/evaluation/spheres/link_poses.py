"""Where the links of a tree are, and trees with some joints held.

The truth about a robot's self-collision: every pair of link meshes, tested by coal's trees of boxes.

Two meshes collide where their surfaces meet. A link wholly inside another is not seen.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import coal
import numpy as np
from numpy.typing import NDArray

from golem.errors import check_known
from golem.robots.model.link_geometry import LinkGeometry, joint_names, joint_pose, joint_value
from golem.types import Array


class MeshOracle:
    """Tests pairs of links with their meshes."""

    def __init__(self, links: Sequence[LinkGeometry], pairs: NDArray[np.int64]) -> None:
        """Build a tree per link, those with surfaces; `pairs` (n, 2) are indices of the links to test."""
        self.links, self.pairs = tuple(links), pairs.reshape(-1, 2)
        self._trees = [link_tree(link) if link.parts else None for link in links]
        self._balls = [_ball(link) for link in links]
        self._request = coal.CollisionRequest()

    def touching(self, q: Array) -> NDArray[np.bool_]:
        """Return which pairs touch at `q`, one position per joint (n,) bool."""
        poses = link_poses(self.links, q)
        centres = np.array([T[:3, :3] @ c + T[:3, 3] for T, (c, _) in zip(poses, self._balls, strict=True)])
        reach = np.array([r for _, r in self._balls])
        a, b = self.pairs.T
        near = np.linalg.norm(centres[a] - centres[b], axis=1) <= reach[a] + reach[b]
        placed = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in poses]
        found = np.zeros(len(self.pairs), bool)
        for i in np.flatnonzero(near):
            found[i] = self._touch(placed, int(a[i]), int(b[i]))
        return found

    def collides(self, q: Array) -> bool:
        """Return whether any pair touches at `q`, one position per joint; stops at the first."""
        poses = link_poses(self.links, q)
        placed = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in poses]
        return any(self._touch(placed, int(a), int(b)) for a, b in self.pairs)

    def _touch(self, placed: list[coal.Transform3s], a: int, b: int) -> bool:
        one, other = self._trees[a], self._trees[b]
        if one is None or other is None:
            return False
        return coal.collide(one, placed[a], other, placed[b], self._request, coal.CollisionResult()) > 0


def link_tree(link: LinkGeometry) -> coal.BVHModelOBBRSS:
    """Return the tree of a link with a surface, in its frame."""
    tree = coal.BVHModelOBBRSS()
    vertices = np.concatenate([p.vertices for p in link.parts])
    first = np.cumsum([0, *(len(p.vertices) for p in link.parts[:-1])])
    faces = np.concatenate([p.faces + n for p, n in zip(link.parts, first, strict=True)])
    tree.beginModel(len(faces), len(vertices))
    tree.addVertices(vertices)
    tree.addTriangles(faces)
    tree.endModel()
    return tree


def _ball(link: LinkGeometry) -> tuple[Array, float]:
    if not link.parts:
        return np.zeros(3), -np.inf
    vertices = np.concatenate([p.vertices for p in link.parts])
    centre = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    return centre, float(np.linalg.norm(vertices - centre, axis=1).max())


def link_poses(links: Sequence[LinkGeometry], q: Array) -> Array:
    """Return the (n, 4, 4) poses of `links`, parents first, in the base; `q` as in `joint_names` [rad or m]."""
    poses = np.empty((len(links), 4, 4))
    values = dict(zip(joint_names(links), (float(v) for v in q), strict=True))
    for i, link in enumerate(links):
        local = joint_pose(link, joint_value(link, values))
        poses[i] = local if link.parent < 0 else poses[link.parent] @ local
    return poses


def hold_joints(links: Sequence[LinkGeometry], held: Mapping[str, float]) -> tuple[LinkGeometry, ...]:
    """Return the links with some joints, and their followers, fixed [rad or m]. Raises ConfigError: there is none."""
    names = joint_names(links)
    check_known("joint", names, *held)
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
