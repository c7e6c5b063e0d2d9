"""Pairs of points across the rim of a hollow thing, and how far its wall leans: a hand has to lean with it.

What hangs on its rim turns about the fingers, its bottom outwards. Two pads are against that if the outer one touches
below the inner one. So the hand leans a little further than the wall does; an upright hand on a bowl's leaning wall has
its outer pad at the rim, and the bowl turns out of it.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from scipy.spatial import KDTree

from golem.capabilities.grasping.object_cloud import PIXEL, across
from golem.types import Array


def outline(flat: Array) -> tuple[Array, Array]:
    """Return points (n, 2) on the outer border of a cloud (m, 2) in a plane [m], and their outward normals (n, 2)."""
    found = _borders(flat, cv2.RETR_EXTERNAL, 5)
    return max(found, key=lambda one: len(one[0])) if found else (np.zeros((0, 2)), np.zeros((0, 2)))


def borders(flat: Array) -> tuple[Array, Array]:
    """Return the same of all borders of all pieces of a cloud, those of holes, too."""
    found = _borders(flat, cv2.RETR_CCOMP, 3) if len(flat) else []
    spots, normals = ([np.zeros((0, 2)), *(one[0] for one in found)], [np.zeros((0, 2)), *(one[1] for one in found)])
    return np.concatenate(spots), np.concatenate(normals)


def _borders(flat: Array, which: int, closing: int) -> list[tuple[Array, Array]]:
    """Return points (n, 2) and outward normals (n, 2) of each border that OpenCV's mode `which` finds."""
    low = flat.min(axis=0) - 4 * PIXEL
    pixels = np.round((flat - low) / PIXEL).astype(int)
    image = np.zeros(tuple(pixels.max(axis=0) + 5), np.uint8)
    image[tuple(pixels.T)] = 1
    image = cv2.morphologyEx(image, cv2.MORPH_CLOSE, np.ones((closing, closing), np.uint8))
    rings, levels = cv2.findContours(image, which, cv2.CHAIN_APPROX_NONE)
    return [
        _smoothed(ring[:, 0, ::-1].astype(np.float64), low, hole=which == cv2.RETR_CCOMP and level[3] >= 0)
        for ring, level in zip(rings, levels[0], strict=True)
        if len(ring) >= 12
    ]


def _smoothed(ring: Array, low: Array, *, hole: bool) -> tuple[Array, Array]:
    """Return a border (n, 2) in pixels as points [m], and their normals (n, 2), away from what it is the border of."""
    smooth = np.mean([np.roll(ring, k, axis=0) for k in range(-2, 3)], axis=0)
    step = min(max(len(ring) // 16, 3), 6)
    along = np.roll(smooth, -step, axis=0) - np.roll(smooth, step, axis=0)
    normals = np.column_stack([along[:, 1], -along[:, 0]]) / (np.linalg.norm(along, axis=1)[:, None] + 1e-9)
    # Which way round a border goes tells which side is out.
    area = float(np.sum(smooth[:, 0] * np.roll(smooth[:, 1], -1) - np.roll(smooth[:, 0], -1) * smooth[:, 1]))
    return smooth * PIXEL + low, normals if (area > 0.0) != hole else -normals


RIM = 0.018
"""Thickness of the layer nearest to the hand that is a rim, if it is thin [m]; a wrong tilt of the camera leans it."""
THIN = 0.020
"""Widest rim [m], as the layer's image shows it."""
STRAIGHT = 0.97
"""Cosine of the angle at which a pair may cross a rim."""
RIMS = 40
"""Pairs across a rim that are returned at most."""
DEEPER = 0.015
"""How much further than elsewhere the fingertips go on both sides of a rim [m]: what hangs on it turns the less."""
QUALITY = 0.7
"""What a pair across a rim is worth."""
SLICE, WALL, HIGH = 0.010, 0.025, (0.003, 0.030)
"""A wall is what lies within so much beside the pair, inside of it, and below the rim [m]."""
SEEN = 12
"""Points that a wall has to have: one that is upright is not seen from above."""
SPAN = 0.010
"""Height over which the middle 80 % of those points have to be spread [m]: of an upright wall no more than its rounded
edge is seen, and the noise of that leans."""
LEANING = 0.15
"""A wall that leans less is upright to the eye [rad]."""
FURTHER, MOST = 0.17, 0.50
"""How much further than its wall the hand leans, and how far at most [rad]."""
LESS = 0.7
"""What a hand counts that leans no further than the wall, and its share of the lean at most."""


def rim_pairs(cloud: Array, approach: Array) -> tuple[Array, Array, Array, Array]:
    """Return pairs across the rim of the nearest layer of a cloud, where that is thin.

    Args:
        cloud: (n, 3) points of the thing [m].
        approach: (3,) unit vector along which the hand comes.

    Returns:
        middles (m, 3), closing axes (m, 3) that lean with the wall, widths (m,) [m], and quality (m,).
    """
    u, v = across(approach)
    along = cloud @ approach
    first = float(np.quantile(along, 0.01))
    spots, normals = borders(cloud[along < first + RIM] @ np.column_stack([u, v]))
    pairs = KDTree(spots).query_pairs(THIN, output_type="ndarray") if len(spots) else np.zeros((0, 2), int)
    a, b = pairs[:, 0], pairs[:, 1]
    way = spots[b] - spots[a]
    width = np.linalg.norm(way, axis=1)
    cosine = np.minimum(-np.einsum("ij,ij->i", normals[a], way), np.einsum("ij,ij->i", normals[b], way))
    thin = np.flatnonzero((width > PIXEL) & (cosine > STRAIGHT * width))
    thin = thin[np.linspace(0, len(thin) - 1, min(RIMS, len(thin))).astype(int)]
    a, b, width = a[thin], b[thin], width[thin]
    flat = 0.5 * (spots[a] + spots[b])
    level = flat[:, :1] * u + flat[:, 1:] * v
    axes = (way[thin, :1] * u + way[thin, 1:] * v) / width[:, None]
    middles = level + (first + DEEPER) * approach
    outward = axes * np.sign(np.einsum("ij,ij->i", axes, level - cloud.mean(axis=0)))[:, None]
    walls = np.array([wall_lean(cloud - level[k], axis, approach, first) for k, axis in enumerate(outward)])
    slanted = walls > LEANING
    leans = np.where(slanted, np.minimum(walls + FURTHER, MOST), 0.0)
    # A wrist that cannot lean so far leans with the wall.
    index = np.concatenate([np.arange(len(walls)), np.flatnonzero(slanted)])
    leans = np.concatenate([leans, np.minimum(walls[slanted], LESS * MOST)])[:, None]
    leaning = np.cos(leans) * outward[index] + np.sin(leans) * approach
    quality = np.where(np.arange(len(index)) < len(walls), QUALITY, LESS * QUALITY)
    return middles[index], leaning, width[index], quality


def wall_lean(points: Array, outward: Array, approach: Array, first: float) -> float:
    """Return how far the wall below a rim leans outwards [rad]; 0 where too little of it is seen.

    Args:
        points: (n, 3) of the thing, from a point of the rim that is at depth 0 [m].
        outward: (3,) unit vector across the rim, away from the thing's middle.
        approach: (3,) unit vector across it, into the thing.
        first: depth of the rim [m].
    """
    inside, depth = -points @ outward, points @ approach - first
    near = (np.abs(points @ np.cross(outward, approach)) < SLICE) & (np.abs(inside) < WALL)
    near &= (depth > HIGH[0]) & (depth < HIGH[1])
    if near.sum() < SEEN or np.ptp(np.quantile(depth[near], (0.1, 0.9))) < SPAN:
        return 0.0
    return math.atan(float(np.polyfit(depth[near], inside[near], 1)[0]))
