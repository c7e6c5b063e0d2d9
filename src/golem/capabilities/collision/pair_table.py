"""Which links and spheres of a robot are tested against each other, found by sampling postures.

Links that move as one or share a joint are left out, and so are those that touch in nearly every posture, or come
near in none. Near a joint, as at a shoulder, conservative spheres overlap though their links never touch. So some pairs
of spheres are ignored, and the others may overlap by a depth: whatever sees every sampled contact of the two links, and
gives the fewest false alarms.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.collision.link_poses import joint_names, link_poses, neighbours
from golem.capabilities.collision.mesh_oracle import MeshOracle
from golem.capabilities.collision.sphere_packer import Packing
from golem.robots.model.link_geometry import LinkGeometry
from golem.types import Array

ALWAYS = 0.9
"""Share of the postures in which links touch that count as always touching."""
NEAR = 0.15
"""Links whose spheres come no nearer in any posture are never tested [m]; samples of two hands seldom meet."""
SHARES = (1.0, 0.5, 0.3, 0.1, 0.03)
"""Spheres that overlap in more than such a share of the postures, links apart, are ignored: these are tried."""
ALARMS = 0.01
"""Share of postures in which the spheres of two links may raise a false alarm, so that nothing is done about it."""
CONTACTS = 200
"""Sampled contacts of two links from which on their spheres are allowed to overlap."""
SAFETY = 0.001
"""How much less they may overlap than in the shallowest contact [m]."""
ZERO_SPREAD = 0.35
"""Standard deviation of the half of the postures that lie around zero [rad]."""


def sample_postures(links: Sequence[LinkGeometry], n: int, seed: int, still: Sequence[str] = ()) -> Array:
    """Return (n, joints) postures: the first half around zero, the others anywhere in the ranges.

    Args:
        links: of the robot.
        n: number of postures.
        seed: of the samples.
        still: joints that stay at zero.
    """
    rng = np.random.default_rng(seed)
    moving = [link for link in links if link.kind != "fixed"]
    lower, upper = np.array([link.lower for link in moving]), np.array([link.upper for link in moving])
    around = np.clip(ZERO_SPREAD * rng.standard_normal((n // 2, len(moving))), lower, upper)
    postures = np.concatenate([around, rng.uniform(lower, upper, (n - n // 2, len(moving)))])
    postures[:, [link.joint in still for link in moving]] = 0.0
    return postures


@dataclass(frozen=True, slots=True)
class PairTable:
    """See `SphereRobot` for `pairs`, `allowed` and `ignored`; `always` names links that always touch."""

    pairs: NDArray[np.int64]
    allowed: Array
    ignored: NDArray[np.int64]
    always: tuple[tuple[str, str], ...]


def find_pairs(links: Sequence[LinkGeometry], packings: Sequence[Packing], postures: Array) -> PairTable:
    """Return what is tested.

    Args:
        links: with surfaces.
        packings: conservative spheres of each link.
        postures: (n, joints) samples.
    """
    apart = neighbours(links)
    solid = [i for i, link in enumerate(links) if link.parts]
    every: NDArray[np.int64] = np.array([p for p in combinations(solid, 2) if p not in apart], np.int64)
    every = every.reshape(-1, 2)
    assert postures.shape[1] == len(joint_names(links))
    poses = np.array([link_poses(links, q) for q in postures])
    oracle = MeshOracle(links, every)
    touching = np.array([oracle.touching(q) for q in postures])
    first = np.cumsum([0, *(len(p.radii) for p in packings)])
    centres = [
        np.einsum("nij,kj->nki", poses[:, i, :3, :3], p.centres) + poses[:, i, None, :3, 3]
        for i, p in enumerate(packings)
    ]
    kept: list[tuple[int, int]] = []
    ignored = [np.zeros((0, 2), np.int64)]
    allowed: list[float] = []
    always: list[tuple[str, str]] = []
    for (a, b), touch in zip(every, touching.T, strict=True):
        if touch.mean() > ALWAYS:
            always.append((links[a].name, links[b].name))
            continue
        gaps = _gaps(centres[a], centres[b], packings[a].radii[:, None] + packings[b].radii)
        if gaps.min() > NEAR:
            continue
        bad, depth = _tuned(gaps, touch)
        kept.append((int(a), int(b)))
        allowed.append(depth)
        ignored.append(np.argwhere(bad) + np.array([first[a], first[b]], np.int64))
    return PairTable(
        np.array(kept, np.int64).reshape(-1, 2), np.array(allowed), np.concatenate(ignored), tuple(always)
    )


def _tuned(gaps: NDArray[np.float32], touch: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], float]:
    """Return which spheres (k, l) to ignore and how deep the others may overlap, given gaps (n, k, l) and contacts."""
    share = (gaps[~touch] <= 0.0).mean(axis=0) if not touch.all() else np.zeros(gaps.shape[1:])
    best = np.zeros(share.shape, bool), 0.0
    best_alarms = float((gaps[~touch] <= 0.0).any(axis=(1, 2)).sum())
    if best_alarms <= ALARMS * len(gaps):
        return best
    for limit in SHARES:
        bad = share > limit
        if bad.all():
            break
        nearest = np.where(bad, np.inf, gaps).min(axis=(1, 2))
        shallowest = float(nearest[touch].max()) if touch.any() else 0.0
        if shallowest > 0.0:
            break
        depth = max(0.0, -shallowest - SAFETY) if touch.sum() >= CONTACTS else 0.0
        alarms = float((nearest[~touch] <= -depth).sum())
        if alarms < best_alarms:
            best, best_alarms = (bad, round(depth, 5)), alarms
    return best


def _gaps(a: Array, b: Array, reach: Array) -> NDArray[np.float32]:
    """Return (n, k, l) distances between the surfaces of (n, k) and (n, l) spheres [m]."""
    out = np.empty((len(a), a.shape[1], b.shape[1]), np.float32)
    for i in range(len(a)):
        out[i] = np.linalg.norm(a[i][:, None] - b[i], axis=2) - reach
    return out
