"""From the network's maps to detections: peaks of the heatmaps, sub-pixel centres, boxes."""

from __future__ import annotations

import cv2
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
    """Return an image as the network takes it.

    Args:
        image: (height, width, 3) RGB.
        mean: (3,) of RGB in 0..1.
        std: (3,) of RGB in 0..1.
        multiple: the sides are padded with the mean colour, right and below, to multiples of this.

    Returns:
        (1, 3, padded height, padded width).
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
    maps: NDArray[np.float32],
    labels: tuple[str, ...],
    wanted: set[str],
    threshold: float,
    size: tuple[int, int],
) -> list[Detection]:
    """Return the detections in one image's maps, best first.

    A peak is a cell that is the greatest of its 3 x 3 neighbourhood in its class; of several on one part, the best
    stays.

    Args:
        maps: (classes + 6, h, w): logits, then the centre's offset [cells] and the log distances to the box's sides.
        labels: names of the classes.
        wanted: the classes to return.
        threshold: smallest score.
        size: width and height of the image [px]; boxes are clipped to it and centres outside dropped.
    """
    width, height = size
    found: list[Detection] = []
    logit = float(np.log(threshold / (1.0 - threshold)))
    for index, label in enumerate(labels):
        if label not in wanted:
            continue
        heat = maps[index]
        peak = (heat >= logit) & (heat >= cv2.dilate(heat, np.ones((3, 3), np.uint8)))
        rows, columns = np.nonzero(peak)
        best = np.argsort(-heat[rows, columns], kind="stable")[:MAX_PEAKS]
        rows, columns = rows[best], columns[best]
        dx, dy, left, top, right, bottom = maps[len(labels) :, rows, columns].astype(np.float64)
        centers = np.column_stack([STRIDE * (columns + dx), STRIDE * (rows + dy)]) + (STRIDE - 1) / 2
        sides = np.exp(np.clip([left, top, right, bottom], 0.0, 7.0)).T
        boxes = np.column_stack([centers - sides[:, :2], centers + sides[:, 2:]])
        boxes = np.clip(boxes, 0.0, [width - 1, height - 1, width - 1, height - 1])
        scores = 1.0 / (1.0 + np.exp(-heat[rows, columns].astype(np.float64)))
        inside = ((centers >= -0.5) & (centers <= np.array(size) - 0.5)).all(axis=1)
        for k in _distinct(np.flatnonzero(inside), centers, boxes):
            found.append(Detection(label, float(scores[k]), boxes[k], centers[k]))
    return sorted(found, key=lambda d: (-d.score, d.center[1], d.center[0]))


def _distinct(order: NDArray[np.intp], centers: Array, boxes: Array) -> list[int]:
    """Return the candidates of `order` (best first) without second peaks on the part of a better one."""
    reach = SAME_SHARE * (boxes[:, 2:] - boxes[:, :2]).min(axis=1)
    kept: list[int] = []
    for k in order:
        if not kept or (np.linalg.norm(centers[kept] - centers[k], axis=1) >= reach[kept]).all():
            kept.append(int(k))
    return kept
