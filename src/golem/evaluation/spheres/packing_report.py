"""What spheres of a robot are worth: how they cover its links, and what they miss of its collisions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.collision.sphere_robot import Packing, SphereRobot, sphere_columns
from golem.evaluation.spheres.link_poses import MeshOracle, link_poses
from golem.evaluation.spheres.surface import LinkSurface
from golem.robots.model.link_geometry import LinkGeometry
from golem.types import Array


@dataclass(frozen=True, slots=True)
class LinkCoverage:
    """How spheres cover one link.

    Attributes:
        covered: share of the outer surface that lies in a sphere, by samples that the packer has not seen.
        gap: of the sample farthest outside every sphere [m]; 0 where all are covered.
        stands_out: mean height of the spheres' own outside above the link [m].
        volume_ratio: volume of the spheres' union over that of the link.
    """

    link: str
    spheres: int
    covered: float
    gap: float
    stands_out: float
    volume_ratio: float


@dataclass(frozen=True, slots=True)
class CollisionScore:
    """What spheres say of postures, against the meshes.

    Attributes:
        postures: how many were tested.
        colliding: how many of them collide by the meshes.
        missed: colliding ones of which the spheres know nothing.
        false_alarms: postures that collide by the spheres alone.
    """

    postures: int
    colliding: int
    missed: int
    false_alarms: int

    @property
    def false_share(self) -> float:
        """False alarms as a share of the postures without a collision."""
        return self.false_alarms / max(1, self.postures - self.colliding)


def coverage(link: str, surface: LinkSurface, packing: Packing, seed: int = 1) -> LinkCoverage:
    """Measure the spheres of one link.

    Args:
        surface: samples that the packer has not seen.
        seed: of the points that the volume is measured with.
    """
    gaps = packing.gap(surface.points)
    rng = np.random.default_rng(seed)
    directions = rng.standard_normal((200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    skin = (packing.centres[:, None] + packing.radii[:, None, None] * directions).reshape(-1, 3)
    outside = surface.height(skin[packing.gap(skin) > -1e-6])
    reach = packing.radii[:, None]
    low, high = (packing.centres - reach).min(axis=0), (packing.centres + reach).max(axis=0)
    drawn = rng.uniform(low, high, (40000, 3))
    volume = float((packing.gap(drawn) <= 0.0).mean() * np.prod(high - low))
    covered, gap, ratio = float((gaps <= 0.0).mean()), max(0.0, float(gaps.max())), volume / max(surface.volume, 1e-12)
    return LinkCoverage(link, len(packing.radii), covered, gap, float(outside.mean()) if len(outside) else 0.0, ratio)


def score_collisions(
    robot: SphereRobot, links: Sequence[LinkGeometry], oracle_pairs: NDArray[np.int64], postures: Array
) -> CollisionScore:
    """Compare spheres and meshes.

    Args:
        oracle_pairs: (n, 2) links that the meshes are tested for.
        postures: (n, joints) of which the packer has seen none.
    """
    oracle = MeshOracle(links, oracle_pairs)
    truth = np.array([oracle.collides(q) for q in postures])
    found = np.array([spheres_collide(robot, q) for q in postures])
    return CollisionScore(len(postures), int(truth.sum()), int((truth & ~found).sum()), int((found & ~truth).sum()))


def spheres_collide(robot: SphereRobot, q: Array) -> bool:
    """Return whether spheres of two tested links overlap at `q`, one position per joint; slow and plain."""
    link, centres, radii = sphere_columns(robot)
    poses = link_poses(robot.links, q)
    placed = np.einsum("nij,nj->ni", poses[link, :3, :3], centres) + poses[link, :3, 3]
    depth = np.full((len(robot.links), len(robot.links)), np.inf)
    depth[tuple(robot.pairs.T)] = robot.allowed
    gap = np.linalg.norm(placed[:, None] - placed, axis=2) - radii[:, None] - radii
    overlap = gap <= -depth[link[:, None], link]
    overlap[tuple(robot.ignored.T)] = False
    return bool(overlap.any())
