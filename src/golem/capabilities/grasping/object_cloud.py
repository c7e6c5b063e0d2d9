"""Which points of a sighting are the object: without the plane it stands on or hangs before, and in one piece.

Which way the ground faces around it, and how high it stands on that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from golem.types import Array, LocalizedObject

PLANE = 0.004
"""Points this near to a plane are on it [m]: depth noise at arm's length."""
SHARE = 0.25
"""Least share of a sighting that makes a plane."""
WIDER = 1.4
"""How much wider a plane is than the thing on it; a thing has flat sides of its own."""
BEHIND, THROUGH = (-0.04, -2.0 * PLANE), 0.05
"""What of a sighting lies so far beyond a plane [m], and its share from which on the plane is a cut through the thing:
nothing is seen behind what a thing stands on."""
HYPOTHESES = 64
"""Planes through three points that are tried."""
TESTED = 800
"""Points that each of them is tried on."""
CELL = 0.012
"""Points of neighbouring cells of this size belong to one piece [m]."""
PIXEL = 0.003
"""Size of a pixel of a silhouette [m]."""
SPARED, EVERY = 0.07, 0.06
"""Radius around points of a thing within which nothing is in a hand's way, and the distance of those points [m]."""
MIN_POINTS = 20
"""Fewer points are no object to grasp."""


def object_points(points: Array, position: Array, seed: int = 0, down: Array | None = None) -> Array:
    """Return the (m, 3) points of the object among the (n, 3) `points` of a sighting [m]; m may be 0.

    A plane that holds at least `SHARE` of the points and does not hold the object's `position` (3,) is what it stands
    on or hangs before (RANSAC): what is on it or behind it goes. Of the rest, the piece nearest to `position` stays.
    What is seen along `down` (3,), a unit vector, is a piece where it is one across it: a bottle is a cap over a
    shoulder, and nothing is seen between them.
    """
    kept = points[np.isfinite(points).all(axis=1)]
    if len(kept) < MIN_POINTS:
        return kept[:0]
    plane = support_plane(kept, position, seed)
    if plane is not None:
        normal, offset = plane
        height = float(position @ normal - offset)
        heights = kept @ normal - offset
        above = heights > np.clip(0.4 * height, 0.5 * PLANE, 2.0 * PLANE)
        through = ((heights > BEHIND[0]) & (heights < BEHIND[1])).mean() > THROUGH
        if not through and _width(kept[np.abs(heights) < PLANE]) > WIDER * _width(kept[above]):
            kept = kept[above]
    if down is None or not len(kept):
        return piece(kept, position)
    return kept[piece_at(kept - np.outer((kept - position) @ down, down), position)]


def _width(points: Array) -> float:
    """Return the standard deviation of points (n, 3) along their second axis [m]."""
    if len(points) < 3:
        return 0.0
    off = points - points.mean(axis=0)
    return float(np.sqrt(np.linalg.eigvalsh(off.T @ off / len(off))[1]))


def support_plane(points: Array, position: Array, seed: int = 0) -> tuple[Array, float] | None:
    """Return the plane that most points (n, 3) lie on and `position` (3,) does not; None where there is none.

    Its (3,) unit normal looks to the side of `position`; with it comes its distance from the origin along that [m].
    """
    rng = np.random.default_rng(seed)
    a, b, c = points[rng.integers(0, len(points), (3, HYPOTHESES))]
    normals = np.cross(b - a, c - a)
    size = np.linalg.norm(normals, axis=1)
    a, normals = a[size > 1e-9], normals[size > 1e-9] / size[size > 1e-9, None]
    offsets = np.einsum("ij,ij->i", a, normals)
    free = np.abs(normals @ position - offsets) > 0.75 * PLANE
    tested = points[rng.permutation(len(points))[:TESTED]]
    counts = (np.abs(tested @ normals.T - offsets) < PLANE).sum(axis=0) * free
    if not len(counts) or counts.max() < SHARE * len(tested):
        return None
    best = int(counts.argmax())
    on = points[np.abs(points @ normals[best] - offsets[best]) < PLANE]
    middle = on.mean(axis=0)
    normal = np.linalg.svd(on[:: max(1, len(on) // TESTED)] - middle, full_matrices=False)[2][2]
    offset = float(middle @ normal)
    if abs(float(position @ normal) - offset) < 0.75 * PLANE:
        return None
    return (normal, offset) if position @ normal > offset else (-normal, -offset)


def piece(points: Array, position: Array) -> Array:
    """Return the connected piece of `points` (n, 3) that is nearest to `position` (3,)."""
    return points[piece_at(points, position)] if len(points) else points


def piece_at(points: Array, position: Array, cell: float = CELL) -> NDArray[np.bool_]:
    """Return which of `points` (n, 3), at least one, are of that piece; those of neighbouring cells [m] are of one."""
    cells = np.floor((points - points.min(axis=0)) / cell).astype(int)
    taken = np.zeros(cells.max(axis=0) + 1, bool)
    taken[tuple(cells.T)] = True
    number = np.zeros(taken.shape, np.int32)
    ndimage.label(taken, np.ones((3, 3, 3)), output=number)
    own = number[tuple(cells.T)]
    return own == own[int(((points - position) ** 2).sum(axis=1).argmin())]


def fullest(values: Array, layer: float) -> float:
    """Return the median of the fullest layer of thickness `layer` of `values` (n,), at least one."""
    ordered = np.sort(values)
    counts = np.searchsorted(ordered, ordered + layer) - np.arange(len(ordered))
    first = int(counts.argmax())
    return float(np.median(ordered[first : first + int(counts[first])]))


def across(approach: Array) -> tuple[Array, Array]:
    """Return two (3,) unit vectors across `approach` (3,) and each other."""
    u = np.cross(approach, (0.0, 0.0, 1.0) if abs(approach[2]) < 0.7 else (1.0, 0.0, 0.0))
    u /= np.linalg.norm(u)
    return u, np.cross(approach, u)


def bounds(points: Array) -> Array:
    """Return the least and the greatest coordinates (2, d) of points (n, d), strays left out."""
    return np.quantile(points, (0.02, 0.98), axis=0)


def thinned(points: Array, most: int, seed: int = 0) -> Array:
    """Return at most `most` of `points` (n, 3), evenly drawn."""
    if len(points) <= most:
        return points
    return points[np.random.default_rng(seed).permutation(len(points))[:most]]


def spaced(points: Array, distance: float = 0.006) -> Array:
    """Return one of `points` (n, 3) per cube of side `distance` [m]."""
    cubes = np.floor(points / distance).astype(np.int64)
    _, first = np.unique(cubes @ (1, 1 << 20, 1 << 40), return_index=True)
    return points[first]


def room_around(points: Array) -> list[tuple[Array, float]]:
    """Return centres (3,) and radii [m] of balls around `points` (n, 3) in which nothing is in a hand's way."""
    return [(point, SPARED) for point in spaced(points, EVERY)]


def normals_of(points: Array, neighbours: int = 16) -> tuple[Array, NDArray[np.bool_]]:
    """Return the (n, 3) unit normals of `points` (n, 3), of either sign, and (n,) whether each is on a surface.

    The normal is the direction in which a point's neighbours spread least (principal components, Hoppe et al. 1992);
    where they spread as much in every direction there is no surface.
    """
    k = min(neighbours, len(points))
    _, index = KDTree(points).query(points, k=k)
    near = points[np.asarray(index).reshape(len(points), k)]
    off = near - near.mean(axis=1, keepdims=True)
    values, vectors = np.linalg.eigh(np.einsum("nki,nkj->nij", off, off))
    return vectors[:, :, 0], values[:, 0] < 0.3 * values[:, 1]


STANDS_PROUD = 0.004
"""What is less than this below the object's top is the object [m]."""
THICKNESS = 0.004
"""Points further than this from the first plane are not ground [m]."""
MIN_GROUND = 60
"""Fewer points give no plane."""
STEEPEST = 0.35
"""A plane steeper than this against the vertical is not the ground the object stands on [rad]."""


def height_above_ground(sighting: LocalizedObject) -> float | None:
    """Return how high the object's top is above the lowest tenth of its cloud [m]; None without a cloud."""
    if len(sighting.points) == 0:
        return None
    return float(sighting.position[2]) - float(np.quantile(sighting.points[:, 2], 0.1))


def ground_plane(sighting: LocalizedObject) -> tuple[Array, float] | None:
    """Return the ground's upward unit normal (3,), and how high an object's top is above it [m]; None: unknown.

    A least-squares plane z = a x + b y + c through the points below the object's top, fitted twice: the second time
    without what lies off the first plane.
    """
    points = sighting.points[sighting.points[:, 2] < sighting.position[2] - STANDS_PROUD]
    normal, height = None, 0.0
    for _ in range(2):
        if len(points) < MIN_GROUND:
            return None
        middle = points.mean(axis=0)
        d = points - middle
        xx, xy, yy = d[:, 0] @ d[:, 0], d[:, 0] @ d[:, 1], d[:, 1] @ d[:, 1]
        xz, yz = d[:, 0] @ d[:, 2], d[:, 1] @ d[:, 2]
        determinant = xx * yy - xy * xy
        if determinant < 1e-4 * (xx + yy) ** 2:
            return None
        a = (xz * yy - yz * xy) / determinant
        b = (yz * xx - xz * xy) / determinant
        points = points[np.abs(d[:, 2] - a * d[:, 0] - b * d[:, 1]) < THICKNESS]
        normal = np.array([-a, -b, 1.0]) / np.sqrt(a * a + b * b + 1.0)
        height = float((sighting.position - middle) @ normal)
    return (normal, height) if normal is not None and np.arccos(normal[2]) < STEEPEST else None
