"""Covers a closed or open triangle mesh with spheres.

In the spirit of MorphIt (HIRO group), with another objective: cover is one-sided. A sphere stands at a centre c inside
the mesh with the radius r = d(c) + overshoot, d being the distance to the surface, so none protrudes by more than the
overshoot. Spheres are chosen greedily by how much uncovered surface each covers (set cover; Chvatal, 1979), at the
smallest overshoot that needs no more than the wanted number. A point of the surface counts as covered when it lies
within `gap` of a sphere: 0 is a conservative set, more a tight one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from golem.errors import ConfigError
from golem.types import Array

SAMPLES = 3000
"""Points that stand for the surface of a mesh."""
CANDIDATES = 3000
"""Centres to choose from, at most."""
BISECTIONS = 9
"""Halvings of the interval in which the overshoot is sought: to 0.1 mm from 60 mm."""
LARGEST_OVERSHOOT = 0.06
"""How far a sphere may stand out at most [m]."""
INSIDE = 0.5
"""Generalised winding number from which on a point is inside (Jacobson et al., 2013)."""


@dataclass(frozen=True, slots=True)
class Packing:
    """Spheres of one mesh.

    Attributes:
        centres: (n, 3) in the frame of the mesh [m].
        radii: (n,) [m].
        overshoot: how far a sphere may stand out of the mesh [m].
    """

    centres: Array
    radii: Array
    overshoot: float


def pack(vertices: Array, faces: Array, count: int, gap: float = 0.0, seed: int = 0) -> Packing:
    """Return at most `count` spheres that cover the surface of a mesh up to `gap`.

    Args:
        vertices: (v, 3) [m].
        faces: (f, 3) indices of vertices.
        count: most spheres.
        gap: distance from a sphere up to which a point of the surface counts as covered [m].
        seed: of the samples.

    Raises:
        ConfigError: the mesh has no area, or is not finite.
    """
    triangles = _triangles(vertices, faces)
    rng = np.random.default_rng(seed)
    surface = sample_surface(triangles, SAMPLES, rng)
    # Between two samples the surface is uncovered by as much: half of what a sphere has to give on top.
    spacing = float(np.quantile(cKDTree(surface).query(sample_surface(triangles, SAMPLES, rng))[0], 0.99))
    tree = cKDTree(surface)
    candidates = _candidates(triangles, surface, rng)
    depth = np.asarray(tree.query(candidates)[0])
    low, high = 0.0, LARGEST_OVERSHOOT
    best: list[int] | None = None
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        chosen = _cover(surface, candidates, depth + middle + gap - spacing, count)
        if chosen is None:
            low = middle
        else:
            high, best = middle, chosen
    if best is None:
        best = _cover(surface, candidates, depth + high + gap - spacing, len(candidates)) or [0]
        best = best[:count]
    centres, radii = _trim(surface, candidates[best], depth[best] + high, gap, spacing)
    return Packing(centres, radii, high)


def sample_surface(triangles: Array, count: int, rng: np.random.Generator) -> Array:
    """Return (count, 3) points spread evenly over (f, 3, 3) `triangles`."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    # Stratified: with independent draws some of the surface would have no sample nearby.
    level = (np.arange(count) + rng.random(count)) / count
    order = np.argsort(triangles.mean(axis=1) @ np.array([1.0, 0.61, 0.37]))
    cumulative = np.cumsum(area[order])
    index = order[np.searchsorted(cumulative, level * cumulative[-1]).clip(max=len(area) - 1)]
    u, v = rng.random((2, count))
    flip = u + v > 1.0
    u, v = np.where(flip, 1.0 - u, u)[:, None], np.where(flip, 1.0 - v, v)[:, None]
    return a[index] + u * (b - a)[index] + v * (c - a)[index]


def winding(points: Array, triangles: Array) -> Array:
    """Return the generalised winding number of the mesh at each of the (n, 3) points: 1 inside, 0 outside.

    Solid angle of a triangle by van Oosterom and Strackee (1983).
    """
    total = np.zeros(len(points))
    for start in range(0, len(points), 64):
        p = points[start : start + 64, None]
        a, b, c = (triangles[None, :, i] - p for i in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=2) for x in (a, b, c))
        volume = np.einsum("pti,pti->pt", a, np.cross(b, c))
        dot_ab, dot_bc, dot_ca = ((x * y).sum(axis=2) for x, y in ((a, b), (b, c), (c, a)))
        denominator = la * lb * lc + dot_ab * lc + dot_bc * la + dot_ca * lb
        total[start : start + 64] = np.arctan2(volume, denominator).sum(axis=1) / (2.0 * np.pi)
    return total


def _triangles(vertices: Array, faces: Array) -> Array:
    points = np.asarray(vertices, dtype=np.float64)
    if points.ndim != 2 or points.shape[-1] != 3 or not np.isfinite(points).all() or len(faces) == 0:
        raise ConfigError("A mesh to be packed has finite vertices (n, 3) and at least one triangle.")
    triangles = points[np.asarray(faces, dtype=int)]
    area = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    if area.sum() <= 0.0:
        raise ConfigError("A mesh to be packed has an area; all triangles of this one are degenerate.")
    return triangles[area > 0.0]


def _candidates(triangles: Array, surface: Array, rng: np.random.Generator) -> Array:
    """Return (n, 3) centres to choose from: a grid of the inside, and points of the surface for what is thin."""
    low, high = surface.min(axis=0), surface.max(axis=0)
    size = np.maximum(high - low, 1e-4)
    step = float(np.cbrt(size.prod() / CANDIDATES))
    axes = [np.arange(a + 0.5 * step, b, step) if b - a > step else np.array([(a + b) / 2]) for a, b in zip(low, high, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    coarse = triangles if len(triangles) <= 4000 else triangles[_largest(triangles, 4000)]
    inside = grid[winding(grid, coarse) > INSIDE]
    thin = surface[rng.choice(len(surface), min(600, len(surface)), replace=False)]
    return np.concatenate([inside, thin])


def _largest(triangles: Array, count: int) -> Array:
    area = np.linalg.norm(
        np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1
    )
    return np.argsort(area)[-count:]


def _cover(surface: Array, centres: Array, reach: Array, most: int) -> list[int] | None:
    """Return which centres cover every point of the surface, each within its reach; None if that takes too many."""
    tree = cKDTree(surface)
    lists = tree.query_ball_point(centres, np.maximum(reach, 0.0))
    covers = np.zeros((len(centres), len(surface)), dtype=np.float32)
    for i, found in enumerate(lists):
        covers[i, found] = 1.0
    open_points = np.ones(len(surface), dtype=np.float32)
    chosen: list[int] = []
    gain = covers.sum(axis=1)
    while open_points.any():
        index = int(np.argmax(gain))
        if gain[index] < 0.5 or len(chosen) == most:
            return None
        chosen.append(index)
        new = (covers[index] > 0.0) & (open_points > 0.0)
        gain = gain - covers[:, new].sum(axis=1)
        open_points[new] = 0.0
    return chosen


def _trim(
    surface: Array, centres: Array, radii: Array, gap: float, spacing: float
) -> tuple[Array, Array]:
    """Return the spheres, each as small as what it alone has to cover allows."""
    away = np.linalg.norm(surface[:, None] - centres[None], axis=2)
    owner = np.argmin(away - radii[None], axis=1)
    kept: list[int] = []
    small = radii.copy()
    for i in range(len(centres)):
        own = away[owner == i, i]
        if len(own):
            kept.append(i)
            small[i] = min(radii[i], max(float(own.max()) + spacing - gap, 1e-3))
    return centres[kept], small[kept]
