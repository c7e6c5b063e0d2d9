"""From the network's maps to detections: peaks of the heatmaps, sub-pixel centres, boxes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, Detection

STRIDE = 4
"""Pixels per cell of the maps; the middle of cell j is pixel 4 j + 1.5, as pixel centres are integers."""
MAX_PEAKS = 200
"""Candidates per class that are looked at; a pack has 68 fasteners."""
SAME_SHARE = 0.35
"""Two centres of one class closer than this share of the better one's shorter side are one part."""


def normalise(image: NDArray[np.uint8], mean: Array, std: Array, multiple: int) -> NDArray[np.float32]:
    """Return an image as the network takes it, (1, 3, padded height, padded width).

    Args:
        image: (height, width, 3) RGB.
        mean: (3,) of RGB in 0..1.
        std: (3,) of RGB in 0..1.
        multiple: the sides are padded with the mean colour, right and below, to multiples of this.
    """
    height, width = image.shape[:2]
    padded = np.zeros((1, 3, -(-height // multiple) * multiple, -(-width // multiple) * multiple), np.float32)
    scale = (1.0 / (255.0 * std)).astype(np.float32)
    shift = (-mean / std).astype(np.float32)
    for channel in range(3):
        np.multiply(image[..., channel], scale[channel], out=padded[0, channel, :height, :width])
        padded[0, channel, :height, :width] += shift[channel]
    return padded


def find_peaks(
    maps: NDArray[np.float32], labels: tuple[str, ...], wanted: set[str], threshold: float, size: tuple[int, int]
) -> list[Detection]:
    """Return the detections in one image's maps, best first.

    A peak is a cell that is the greatest of its 3 x 3 neighbourhood in its class; of several on one part, the best
    stays.

    Args:
        maps: (classes + 6, h, w): logits, then the centre's offset [cells] and the log distances to the box's sides.
        size: width and height of the image [px]; boxes are clipped to it and centres outside dropped.
    """
    width, height = size
    last = np.array([width - 1.0, height - 1.0])
    asked = [index for index, label in enumerate(labels) if label in wanted]
    kinds, rows, columns = _peaks(maps[asked], float(np.log(threshold / (1.0 - threshold))))
    found: list[Detection] = []
    for kind in np.unique(kinds):
        label = labels[asked[kind]]
        j, i = rows[kinds == kind], columns[kinds == kind]
        heat = maps[asked[kind], j, i].astype(np.float64)
        best = np.argsort(-heat, kind="stable")[:MAX_PEAKS]
        j, i, scores = j[best], i[best], 1.0 / (1.0 + np.exp(-heat[best]))
        regression = maps[len(labels) :, j, i].astype(np.float64).T
        centers = STRIDE * (np.column_stack([i, j]) + regression[:, :2]) + (STRIDE - 1) / 2
        sides = np.exp(np.clip(regression[:, 2:6], 0.0, 7.0))
        low, high = centers - sides[:, :2], centers + sides[:, 2:]
        boxes = np.clip(np.column_stack([low, high]), 0.0, np.tile(last, 2))
        inside = np.asarray(((centers >= -0.5) & (centers <= last + 0.5)).all(axis=1), bool)
        for k in _distinct(centers, boxes, inside):
            found.append(Detection(label, float(scores[k]), boxes[k], centers[k]))
    return sorted(found, key=lambda d: (-d.score, d.center[1], d.center[0]))


def _peaks(heat: NDArray[np.float32], least: float) -> tuple[NDArray[np.intp], ...]:
    """Return class, row and column of the cells (classes, h, w) that reach `least` and that no neighbour exceeds."""
    at = np.unravel_index(np.flatnonzero(heat >= least), heat.shape)
    around = np.pad(heat, ((0, 0), (1, 1), (1, 1)), constant_values=-np.inf)
    kinds, rows, columns = at
    highest = np.ones(len(kinds), bool)
    for down in range(3):
        for right in range(3):
            highest &= heat[at] >= around[kinds, rows + down, columns + right]
    return kinds[highest], rows[highest], columns[highest]


def _distinct(centers: Array, boxes: Array, free: NDArray[np.bool_]) -> list[int]:
    """Return the `free` candidates, best first, without second peaks on the part of a better one."""
    reach = SAME_SHARE * (boxes[:, 2:] - boxes[:, :2]).min(axis=1)
    distance = np.hypot(*(centers[:, None] - centers[None]).transpose(2, 0, 1))
    free, kept = free.copy(), []
    for k in range(len(centers)):
        if free[k]:
            kept.append(k)
            free &= distance[k] >= reach[k]
    return kept
