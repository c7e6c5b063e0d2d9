"""The truth about a robot's self-collision: every pair of link meshes, tested by coal's trees of boxes.

Two meshes collide where their surfaces meet. A link wholly inside another is not seen.
"""

from __future__ import annotations

from collections.abc import Sequence

import coal
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.collision.link_poses import link_poses
from golem.robots.model.link_geometry import LinkGeometry
from golem.types import Array


class MeshOracle:
    """Tests pairs of links with their meshes."""

    def __init__(self, links: Sequence[LinkGeometry], pairs: NDArray[np.int64]) -> None:
        """Build a tree per link.

        Args:
            links: with surfaces.
            pairs: (n, 2) indices of the links to test.
        """
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
