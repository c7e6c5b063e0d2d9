"""Spheres for a link, in the spirit of MorphIt (HIRO group), with a one-sided promise.

For a point p of the surface, g(p) = min_k |p - c_k| - r_k is its signed distance from the union of the spheres: above
zero a gap. A ball with its centre in depth d and the radius d + t stands out by t at most. A set is the fewest such
balls that cover the surface (greedy set cover; Chvatal, 1979), with centres near the medial axis. A conservative set
is then trimmed to what each ball has to cover, so that no sample has a gap. A tight set starts with the same balls, and
descends the mean of g squared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.collision.sphere_robot import Packing, SphereKind
from golem.evaluation.spheres.surface import DENSITY, LinkSurface, spread
from golem.types import Array

GAP_WEIGHT: dict[SphereKind, float] = {"tight": 1.0, "conservative": 10.0}
"""What a gap counts in the descent against standing out as far."""
CANDIDATES = 2400
SAMPLES = 4000
SMALLEST = 0.002
"""Radius of the smallest sphere [m]."""
BETWEEN = 5e-4
"""Added to the radii of a conservative set, for what lies between the samples [m]."""
ITERATIONS = 80


def pack(surface: LinkSurface, kind: SphereKind, tolerance: float, most: int, seed: int = 0) -> Packing:
    """Return the spheres of a link.

    Args:
        kind: tight or conservative.
        tolerance: how far a sphere may stand out [m]; widened until `most` spheres suffice.
        most: bound on the number of spheres.
        seed: of the choice of candidates.
    """
    rng = np.random.default_rng(seed)
    points = spread(surface.points, surface.step * float(np.sqrt(len(surface.points) / (DENSITY * SAMPLES))))
    centres, depth = _candidates(surface, rng)
    away = np.linalg.norm(points[None] - centres[:, None], axis=2).astype(np.float32)
    chosen, tolerance = _fewest(away, depth, tolerance, most)
    packing = Packing(centres[chosen], np.maximum(depth[chosen] + tolerance, SMALLEST))
    packing = _descend(points, packing, GAP_WEIGHT[kind])
    return _trim(surface.points, packing) if kind == "conservative" else packing


def _candidates(surface: LinkSurface, rng: np.random.Generator) -> tuple[Array, Array]:
    """Return centres (n, 3) and their depth (n,): of the medial axis, others inside, points of the surface."""
    inside = surface.inside
    medial = inside[: len(inside) // 4]
    centres = np.concatenate(
        [
            medial[rng.permutation(len(medial))[: CANDIDATES // 2]],
            inside[rng.permutation(len(inside))[: CANDIDATES // 4]],
            rng.permutation(spread(surface.points, 4.0 * surface.step))[: CANDIDATES // 4],
        ]
    )
    return centres, np.maximum(-surface.height(centres), 0.0)


def _fewest(away: Array, depth: Array, tolerance: float, most: int) -> tuple[list[int], float]:
    """Return the candidates that cover every sample within a tolerance, and the smallest tolerance that allows it."""

    def within(t: float) -> list[int] | None:
        return _cover(away <= (depth + t)[:, None], most)

    best = within(tolerance)
    if best is not None:
        return best, tolerance
    low = high = tolerance
    while best is None:
        low, high = high, 1.5 * high
        best = within(high)
    for _ in range(4):
        middle = 0.5 * (low + high)
        found = within(middle)
        if found is None:
            low = middle
        else:
            best, high = found, middle
    return best, high


def _cover(covers: NDArray[np.bool_], most: int) -> list[int] | None:
    """Return rows of (n, m) `covers` that cover every column, the largest gain first; None if it takes too many."""
    open_points = covers.any(axis=0)
    matrix = covers.astype(np.float32)
    chosen: list[int] = []
    while open_points.any():
        if len(chosen) == most:
            return None
        best = int((matrix @ open_points.astype(np.float32)).argmax())
        chosen.append(best)
        open_points &= ~covers[best]
    return chosen


def _trim(points: Array, packing: Packing) -> Packing:
    """Return the spheres with the radii that cover every point, each point by the sphere that needs least for it."""
    needed = np.zeros(len(packing.radii))
    for p in np.array_split(points, max(1, len(points) // 4000)):
        away = np.linalg.norm(p[:, None] - packing.centres, axis=2)
        owner = (away - packing.radii).argmin(axis=1)
        np.maximum.at(needed, owner, away[np.arange(len(p)), owner])
    used = needed > 0.0
    return Packing(packing.centres[used], np.maximum(needed[used] + BETWEEN, SMALLEST))


def _descend(points: Array, packing: Packing, gap_weight: float) -> Packing:
    n = len(packing.radii)
    low, high = points.min(axis=0), points.max(axis=0)
    scale = 1e-3

    def loss(x: Array) -> tuple[float, Array]:
        c, r = x[: 3 * n].reshape(n, 3), x[3 * n :]
        away = np.sqrt(((points**2).sum(1)[:, None] + (c**2).sum(1) - 2.0 * points @ c.T).clip(1e-12))
        g = away - r
        owner = g.argmin(axis=1)
        rows = np.arange(len(points))
        u = g[rows, owner] / scale
        weight = np.where(u > 0.0, gap_weight, 1.0)
        slope = 2.0 * weight * u / (scale * len(points))
        direction = (c[owner] - points) / away[rows, owner][:, None]
        gradient = np.zeros((n, 4))
        np.add.at(gradient, owner, np.column_stack([slope[:, None] * direction, -slope]))
        return float((weight * u**2).mean()), np.concatenate([gradient[:, :3].ravel(), gradient[:, 3]])

    largest = 0.5 * float((high - low).max()) + SMALLEST
    bounds = [(float(a), float(b)) for _ in range(n) for a, b in zip(low, high, strict=True)]
    bounds += [(SMALLEST, largest)] * n
    start = np.concatenate([packing.centres.ravel(), packing.radii])
    from scipy.optimize import minimize  # 13 MB, for packing only

    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds, options={"maxiter": ITERATIONS})
    return Packing(found.x[: 3 * n].reshape(n, 3), found.x[3 * n :].copy())
