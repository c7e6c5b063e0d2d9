"""How far a thing has moved, or seems to have, from one view of it to another: silhouettes laid over each other."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.grasping.centroid import ACROSS
from golem.capabilities.grasping.object_cloud import MIN_POINTS, PIXEL, across, bounds
from golem.types import Array

TOP = 0.015
"""Height of the layer that is the top of a thing [m]."""
CAP = 0.05
"""Width up to which a top is small enough to be seen whole [m]: a bottle's cap and neck, unlike its shoulder."""
SEARCH = 0.06
"""How far a thing may have moved between two looks [m]."""


@dataclass(frozen=True, slots=True)
class View:
    """What a camera showed: the `thing` (n, 3), and all points `around` (m, 3) with it, in one frame [m]."""

    thing: Array
    around: Array


def shift_between(before: View, after: View, axis: Array) -> Array:
    """Return by how much (3,) a thing has moved from one view to another [m], both along about `axis` (3,).

    Across the axis, it is the shift at which the silhouettes differ in the fewest pixels; pixels of which one view
    knows nothing do not count. Of what has a small top it is that of the top: from one place a camera shows a bottle's
    cap alone, from another its shoulder, too. Along the axis, it is how much nearer or farther what both show is.
    """
    flat = np.column_stack(across(axis))
    if axis[2] < -ACROSS:
        caps = [bounds(top_of(view.thing)) for view in (before, after)]
        if all((high - low)[:2].max() < CAP for low, high in caps):
            aside = flat @ flat.T @ (caps[1].mean(axis=0) - caps[0].mean(axis=0))
            return aside + _farther(before.thing + aside, after.thing, flat, axis) * axis
    return _laid_over(before, after, flat, axis)


def top_of(points: Array) -> Array:
    """Return the highest of points (n, 3)."""
    return points[points[:, 2] > np.quantile(points[:, 2], 0.98) - TOP]


def _laid_over(before: View, after: View, flat: Array, axis: Array) -> Array:
    """Return the shift by the silhouettes; see `shift_between`.

    Args:
        before: one view.
        after: the other.
        flat: (3, 2) axes of the silhouettes, across `axis`.
        axis: (3,) along which both look.
    """
    low = np.minimum((before.thing @ flat).min(axis=0), (after.thing @ flat).min(axis=0)) - SEARCH
    high = np.maximum((before.thing @ flat).max(axis=0), (after.thing @ flat).max(axis=0)) + SEARCH
    size, edge = np.ceil((high - low) / PIXEL).astype(int) + 1, round(SEARCH / PIXEL)
    (one, known), (two, seen) = (_silhouette(view, flat, low, size) for view in (before, after))
    two, seen = (np.pad(image, edge) for image in (two, seen))

    def overlap(image: NDArray[np.float32], template: NDArray[np.float32]) -> Array:
        return np.asarray(cv2.matchTemplate(image, template, cv2.TM_CCORR), np.float64)

    shared = overlap(seen, known)
    differ = overlap(seen - two, one) + overlap(two, known - one)
    differ = np.where(shared > 0.5 * shared.max(), differ / np.maximum(shared, 1.0), np.inf)
    i, j = np.unravel_index(int(differ.argmin()), differ.shape)
    best = np.array([i + _vertex(differ[:, j], int(i)), j + _vertex(differ[i], int(j))]) - edge
    aside = flat @ (best * PIXEL)
    return aside + _farther(before.thing + aside, after.thing, flat, axis) * axis


def _farther(before: Array, after: Array, flat: Array, axis: Array) -> float:
    """Return how much farther along `axis` (3,) a thing is after than before [m], where both views show it.

    Both are points (n, 3) of it, across the axis in the same place; a hand above a rim shows the other side of a bowl.
    Of what is seen from above the top counts: where one view has the bottom of a mug, the other has its wall before it.
    """
    if axis[2] < -ACROSS:
        before, after = top_of(before), top_of(after)
    views = before @ flat, after @ flat
    both = np.concatenate(views)
    low = both.min(axis=0)
    size = np.ceil((both.max(axis=0) - low) / PIXEL).astype(int)
    layers = np.full((2, *(size + 2)), np.inf)
    for layer, spots, points in zip(layers, views, (before, after), strict=True):
        np.minimum.at(layer, tuple(np.round((spots - low) / PIXEL).astype(int).T), points @ axis)
    shared = np.isfinite(layers).all(axis=0)
    if shared.sum() < MIN_POINTS:
        return float(np.quantile(after @ axis, 0.1) - np.quantile(before @ axis, 0.1))
    return float(np.median(layers[1][shared] - layers[0][shared]))


def _vertex(values: Array, k: int) -> float:
    """Return how far from the least value, the `k`-th, the parabola through it and its neighbours is least."""
    if not 0 < k < len(values) - 1 or not np.isfinite(values[k - 1 : k + 2]).all():
        return 0.0
    a, b, c = (float(v) for v in values[k - 1 : k + 2])
    return 0.5 * (a - c) / max(a - 2.0 * b + c, 1e-6)


def _silhouette(
    view: View, flat: Array, low: Array, size: NDArray[np.intp]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return two images of `size` pixels from `low` (2,) on: where the thing is, and what the camera has in view."""
    thing, seen = np.zeros(tuple(size), np.uint8), np.zeros(tuple(size), np.uint8)
    pixels = np.round((view.thing @ flat - low) / PIXEL).astype(int)
    thing[tuple(pixels[((pixels >= 0) & (pixels < size)).all(axis=1)].T)] = 1
    closed = np.asarray(cv2.morphologyEx(thing, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8)), np.float32)
    # What the thing hides is in view, too: it is not the thing.
    around = np.round((np.concatenate([view.around, view.thing]) @ flat - low) / PIXEL).astype(np.int32)
    cv2.fillConvexPoly(seen, cv2.convexHull(around[:, ::-1]), 1)
    return closed * seen, seen.astype(np.float32)
