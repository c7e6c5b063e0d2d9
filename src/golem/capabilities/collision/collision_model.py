"""Self-collision of a robot's spheres: yes or no, distances, and gradients by its joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.vq import kmeans2

from golem.capabilities.collision import sphere_kernel, world_kernel
from golem.capabilities.collision.obstacles import World
from golem.capabilities.collision.sphere_robot import SphereRobot, sphere_columns
from golem.errors import ConfigError, unknown_name
from golem.robots.model.link_geometry import joint_names, joint_pose, joint_value
from golem.robots.model.spatial import transform
from golem.types import Array

CLUSTER = 6
"""Spheres of a cluster, about."""


@dataclass(frozen=True, slots=True)
class NearPairs:
    """The nearest pairs of links, nearest first.

    Attributes:
        distance: (k,) between their nearest spheres, negative where they overlap by more than they may [m].
        gradient: (k, n) its derivative by the joints [m/rad or m/m].
        spheres: (k, 2) which they are, counted over all links of the model.
    """

    distance: Array
    gradient: Array
    spheres: NDArray[np.int64]


class CollisionModel:
    """Spheres on a chain of joints, compiled for speed. Threads may share it: no call writes to it.

    Attributes:
        joints: names of the n joints, in the order of `q`.
        ints, floats: the model as `sphere_kernel` reads it.
        sphere_body: (m,) body that each sphere is part of, 0 for the base.
        sphere_link: (m,) its link.
    """

    def __init__(
        self, robot: SphereRobot, joints: Sequence[str] | None = None, held: Mapping[str, float] | None = None
    ) -> None:
        """Lay out the tables; a few milliseconds. Raises ConfigError: no joint of that name, or a name occurs twice.

        Args:
            joints: those that `q` moves, in its order; None for all, in the order of the links.
            held: position of other joints [rad or m]; zero where none is given.
        """
        every = joint_names(robot.links)
        self.joints = tuple(every if joints is None else joints)
        for name in (*self.joints, *(held or {})):
            if name not in every:
                raise unknown_name("joint", name, every)
        led = [link for link in robot.links if link.leader in self.joints]
        if led:
            raise ConfigError(
                f"Joint '{led[0].joint}' follows '{led[0].leader}', which can only be held here, not moved."
            )
        if len(set(self.joints)) != len(self.joints):
            raise ConfigError(f"A joint occurs twice among {', '.join(self.joints)}.")
        self.robot = robot
        self._build(held or {})

    def collides(self, q: Array, margin: float = 0.0, world: World | None = None) -> bool:
        """Return whether spheres that are tested come as near as `margin` [m] at `q` (n,), or to the world."""
        if sphere_kernel.collides(q, self.ints, self.floats, margin):
            return True
        if world is None:
            return False
        return world_kernel.world_collides(q, self.ints, self.floats, world.tables, margin)

    def collides_each(self, Q: Array, margin: float = 0.0, world: World | None = None) -> NDArray[np.bool_]:
        """Return (m,) whether each row of `Q` (m, n) collides, see `collides`."""
        Q = np.ascontiguousarray(Q, float)
        out = np.empty(len(Q), np.bool_)
        sphere_kernel.collides_each(Q, self.ints, self.floats, margin, out)
        if world is not None:
            free = np.flatnonzero(~out)
            hit = np.empty(len(free), np.bool_)
            world_kernel.world_collides_each(Q[free], self.ints, self.floats, world.tables, margin, hit)
            out[free] = hit
        return out

    def nearest_world(self, q: Array, world: World, most: int, cutoff: float) -> NearPairs:
        """Return at most `most` moving links that are nearer to the world than `cutoff` [m], nearest first.

        `spheres` is (k, 1): the sphere of the link that is nearest.
        """
        distance, gradient = np.empty(most), np.empty((most, len(self.joints)))
        spheres = np.empty(most, np.int64)
        count = world_kernel.nearest_world(
            q, self.ints, self.floats, self._moving, self.sphere_body, self.sphere_link, world.tables,
            cutoff, distance, gradient, spheres,
        )  # fmt: skip
        order = np.argsort(distance[:count], kind="stable")
        return NearPairs(distance[order], gradient[order], spheres[order, None])

    def nearest(self, q: Array, most: int, cutoff: float) -> NearPairs:
        """Return at most `most` pairs of links that are nearer than `cutoff` [m] at `q` (n,), nearest first."""
        distance, gradient = np.empty(most), np.empty((most, len(self.joints)))
        spheres = np.empty((most, 2), np.int64)
        count = sphere_kernel.nearest_pairs(
            q, self.ints, self.floats, self.sphere_body, cutoff, distance, gradient, spheres
        )
        return NearPairs(distance[:count], gradient[:count], spheres[:count])

    def placed(self, q: Array) -> Array:
        """Return the spheres (m, 4) at `q` (n,): centre in the base and radius [m]."""
        n = len(self.joints)
        out = np.empty((int(self.ints[3]), 4))
        sphere_kernel.place_spheres(q, self.ints, self.floats, np.empty((n + 1, 9)), np.empty((n + 1, 3)), out)
        return out

    def _build(self, held: Mapping[str, float]) -> None:
        robot = self.robot
        column = {name: j for j, name in enumerate(self.joints)}
        order = [link.joint for link in robot.links if link.kind != "fixed" and link.joint in column]
        if order != list(self.joints):
            raise ConfigError(f"The joints come in the order of the robot's links: {', '.join(order)}.")
        n = len(order)
        parents, slides, chain = np.zeros(n, np.int64), np.zeros(n, np.int64), np.zeros((n, 12))
        body = np.zeros(len(robot.links), np.int64)
        T_body_link = np.zeros((len(robot.links), 4, 4))
        for i, link in enumerate(robot.links):
            above = 0 if link.parent < 0 else int(body[link.parent])
            T_above = np.eye(4) if link.parent < 0 else T_body_link[link.parent]
            if link.kind == "fixed" or link.joint not in column:
                body[i] = above
                T_body_link[i] = T_above @ joint_pose(link, joint_value(link, held))
                continue
            j = column[link.joint]
            T_link_axis = transform(link.anchor, _frame_along(link.axis))
            T = T_above @ link.T_parent_link @ T_link_axis
            parents[j], slides[j] = above, link.kind == "slide"
            chain[j, :9], chain[j, 9:] = T[:3, :3].ravel(), T[:3, 3]
            body[i], T_body_link[i] = j + 1, np.linalg.inv(T_link_axis)
        link, centres, radii = sphere_columns(robot)
        T = T_body_link[link]
        centres = np.einsum("nij,nj->ni", T[:, :3, :3], centres) + T[:, :3, 3]
        cluster = _clusters(link, centres, radii)
        sort = np.argsort(cluster, kind="stable")
        rank = np.argsort(sort)
        self.sphere_link, self.sphere_body = link[sort], body[link[sort]]
        self._moving = np.flatnonzero(self.sphere_body > 0)
        spheres, cluster = np.column_stack([centres, radii])[sort], cluster[sort]
        clusters = int(cluster.max(initial=-1)) + 1
        first = np.searchsorted(cluster, np.arange(clusters + 1))
        balls = np.array([_ball(spheres[a:b]) for a, b in zip(first, first[1:], strict=False)])
        link_balls = np.zeros((len(robot.links), 4))
        for i in np.unique(link):
            link_balls[i] = _ball(spheres[self.sphere_link == i])
        cluster_link = self.sphere_link[first[:-1]]
        ignored = {frozenset((int(rank[a]), int(rank[b]))) for a, b in robot.ignored}
        link_pairs, link_first, cluster_pairs, cluster_first, sphere_pairs = [], [0], [], [0], []
        allowed: list[float] = []
        for (a, b), depth in zip(robot.pairs, robot.allowed, strict=True):
            if body[a] == body[b]:
                continue
            for c in np.flatnonzero(cluster_link == a):
                for d in np.flatnonzero(cluster_link == b):
                    kept = [
                        (i, j)
                        for i in range(first[c], first[c + 1])
                        for j in range(first[d], first[d + 1])
                        if frozenset((i, j)) not in ignored
                    ]
                    if kept:
                        cluster_pairs.append((c, d))
                        sphere_pairs += kept
                        cluster_first.append(len(sphere_pairs))
            link_pairs.append((a, b))
            allowed.append(float(depth))
            link_first.append(len(cluster_pairs))
        tables = [
            np.asarray(table, np.int32).ravel()
            for table in (
                parents, slides, body, first, body[cluster_link], link_pairs, link_first,
                cluster_pairs, cluster_first, sphere_pairs,
            )
        ]  # fmt: skip
        numbers = [np.asarray(table, float).ravel() for table in (chain, link_balls, balls, spheres, allowed)]
        head = [n, len(robot.links), clusters, len(spheres), len(link_pairs)]
        head += list(sphere_kernel.HEADER + np.cumsum([len(t) for t in tables])[1:-1])
        head += list(np.cumsum([len(t) for t in numbers])[:-1])
        self.ints: NDArray[np.int32] = np.concatenate([np.asarray(head, np.int32), *tables])
        self.floats: Array = np.concatenate(numbers)


def _frame_along(axis: Array) -> Array:
    """Return a rotation (3, 3) whose z axis is `axis`."""
    x = np.cross(np.eye(3)[int(np.abs(axis).argmin())], axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _clusters(link: NDArray[np.int64], centres: Array, radii: Array) -> NDArray[np.int64]:
    """Return the cluster of each sphere: neighbours on one link."""
    out = np.zeros(len(link), np.int64)
    count = 0
    for i in np.unique(link):
        own = np.flatnonzero(link == i)
        k = -(-len(own) // CLUSTER)
        label = np.zeros(len(own), np.int64)
        if k > 1:
            label = kmeans2(centres[own], k, iter=20, minit="++", rng=np.random.default_rng(0))[1]
        _, label = np.unique(label, return_inverse=True)
        out[own] = count + label
        count += int(label.max()) + 1
    return out


def _ball(spheres: Array) -> Array:
    """Return a ball (4,) around spheres (n, 4): the middle of their box, and what reaches farthest."""
    low = (spheres[:, :3] - spheres[:, 3:]).min(axis=0)
    centre = 0.5 * (low + (spheres[:, :3] + spheres[:, 3:]).max(axis=0))
    return np.append(centre, (np.linalg.norm(spheres[:, :3] - centre, axis=1) + spheres[:, 3]).max())
