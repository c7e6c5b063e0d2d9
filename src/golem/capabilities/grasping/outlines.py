"""Borders of clouds that are seen flat: where a hand that comes straight at them closes its fingers."""

from __future__ import annotations

import cv2
import numpy as np

from golem.capabilities.grasping.object_cloud import PIXEL
from golem.types import Array


def outline(flat: Array) -> tuple[Array, Array]:
    """Return points (n, 2) on the outer border of a cloud (m, 2) in a plane [m], and their outward normals (n, 2)."""
    found = _borders(flat, cv2.RETR_EXTERNAL, 5)
    return max(found, key=lambda one: len(one[0])) if found else (np.zeros((0, 2)), np.zeros((0, 2)))


def borders(flat: Array) -> tuple[Array, Array]:
    """Return the same of all borders of all pieces of a cloud, those of holes, too."""
    found = _borders(flat, cv2.RETR_CCOMP, 3) if len(flat) else []
    spots, normals = (
        [np.zeros((0, 2)), *(one[0] for one in found)],
        [np.zeros((0, 2)), *(one[1] for one in found)],
    )
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
