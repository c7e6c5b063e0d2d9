"""Training crops: zoom, flip, light, colour, blur, dirt and noise on rendered images, with the targets to match."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.peaks import STRIDE
from golem.types import Array

MEAN = (0.45, 0.45, 0.45)
STD = (0.25, 0.25, 0.25)
"""Normalisation of RGB in 0..1."""
CROP = (320, 256)
"""Width and height of a training crop [px]."""
ZOOM = (0.6, 1.35)
LARGE = 15
"""Shorter side from which a part counts as large [cells]."""


def crop(
    image: NDArray[np.uint8], labels: Array, rng: np.random.Generator
) -> tuple[NDArray[np.uint8], Array]:
    """Cut a randomly zoomed and mirrored piece, usually around a part; labels (n, 8) follow."""
    height, width = image.shape[:2]
    w, h = CROP
    zoom = float(np.exp(rng.uniform(*np.log(ZOOM))))
    if len(labels) and rng.random() < 0.85:
        # Rare classes as often as frequent ones.
        kind = rng.choice(np.unique(labels[:, 0]))
        chosen = labels[rng.choice(np.flatnonzero(labels[:, 0] == kind)), 1:3]
        middle = chosen + rng.uniform(-0.42, 0.42, 2) * (w, h) / zoom
    else:
        middle = rng.uniform((0, 0), (width, height))
    flip = -1.0 if rng.random() < 0.5 else 1.0
    scale = np.array([zoom * flip, zoom])
    shift = np.array([(w - 1) / 2, (h - 1) / 2]) - scale * middle
    matrix = np.column_stack([np.diag(scale), shift])
    filling = cv2.BORDER_REFLECT_101 if rng.random() < 0.3 else cv2.BORDER_CONSTANT
    if zoom < 0.8:
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.35 / zoom), np.uint8)
    shade = tuple(float(v) for v in rng.uniform(0, 255, 3))
    piece = cv2.warpAffine(image, matrix, CROP, flags=cv2.INTER_LINEAR, borderMode=filling, borderValue=shade)
    if filling == cv2.BORDER_REFLECT_101:
        # Mirrored parts outside the image would be unlabelled: hide them.
        inside = cv2.warpAffine(np.ones((height, width), np.uint8), matrix, CROP, flags=cv2.INTER_NEAREST)
        piece[inside == 0] = cv2.blur(piece, (41, 41))[inside == 0]
    out = labels.copy()
    for first in (1, 3, 5):
        out[:, first : first + 2] = out[:, first : first + 2] * scale + shift
    if flip < 0:
        out[:, [3, 5]] = out[:, [5, 3]]
    limit = np.array([0.0, 0.0, width - 1.0, height - 1.0])
    frame = np.concatenate([limit[:2] * scale + shift, limit[2:] * scale + shift])
    low = np.maximum(np.minimum(frame[:2], frame[2:]), 0)
    high = np.minimum(np.maximum(frame[:2], frame[2:]), (w - 1, h - 1))
    out[:, 3:5] = np.clip(out[:, 3:5], low, high)
    out[:, 5:7] = np.clip(out[:, 5:7], low, high)
    keep = (out[:, 1:3] >= 0).all(axis=1) & (out[:, 1] <= w - 1) & (out[:, 2] <= h - 1)
    out[:, 7] = np.maximum(out[:, 7], (out[:, 5:7] - out[:, 3:5]).min(axis=1) < 3.0)
    return np.asarray(piece, np.uint8), out[keep]


def corrupt(image: NDArray[np.uint8], rng: np.random.Generator) -> NDArray[np.float32]:
    """Return the image as (3, height, width) float32, normalised, with random exposure, colour, blur and noise."""
    x = image.astype(np.float32) / 255.0
    h, w = x.shape[:2]
    if rng.random() < 0.5:  # uneven light, dirt
        field = rng.standard_normal((int(rng.integers(3, 9)), int(rng.integers(3, 9)), 1)).astype(np.float32)
        field = cv2.resize(field, (w, h), interpolation=cv2.INTER_CUBIC)
        x *= np.exp(rng.uniform(0.02, 0.25) * field)[..., None]
    if rng.random() < 0.3:  # surface texture
        grain = rng.standard_normal((h // 2, w // 2)).astype(np.float32)
        grain = cv2.resize(cv2.GaussianBlur(grain, (0, 0), rng.uniform(0.5, 2.0)), (w, h))
        x += (rng.uniform(0.01, 0.08) * grain)[..., None]
    x *= np.exp(rng.normal(0.0, 0.3)) * np.exp(0.07 * rng.standard_normal(3)).astype(np.float32)
    grey = x.mean(axis=2, keepdims=True)
    x = grey + (x - grey) * np.float32(rng.uniform(0.4, 1.3))
    mean = x.mean()
    x = mean + (x - mean) * np.float32(np.exp(rng.normal(0.0, 0.2)))
    x = np.clip(x, 0.0, 1.2) ** np.float32(np.exp(rng.normal(0.0, 0.15)))
    choice = rng.random()
    if choice < 0.35:
        x = cv2.GaussianBlur(x, (0, 0), rng.uniform(0.3, 1.3))
    elif choice < 0.5:
        length = int(rng.integers(2, 6))
        kernel = np.zeros((7, 7), np.float32)
        direction = rng.uniform(0, np.pi)
        for s in np.linspace(-length / 2, length / 2, 15):
            kernel[round(3 + s * np.sin(direction)), round(3 + s * np.cos(direction))] += 1
        x = cv2.filter2D(x, -1, kernel / kernel.sum())
    if rng.random() < 0.7:
        x += rng.uniform(0.0, 0.04) * rng.standard_normal(x.shape).astype(np.float32)
    x = np.round(np.clip(x, 0.0, 1.0) * 255) / 255
    return np.ascontiguousarray(((x - np.array(MEAN)) / np.array(STD)).transpose(2, 0, 1), dtype=np.float32)


def targets(
    labels: Array, classes: int
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return heatmap (classes, h, w), its weight, and regression (7, h, w: the six channels and their weight)."""
    w, h = CROP[0] // STRIDE, CROP[1] // STRIDE
    heat = np.zeros((classes, h, w), np.float32)
    weight = np.ones_like(heat)
    regression = np.zeros((7, h, w), np.float32)
    rows, columns = np.mgrid[:h, :w]
    middle = (STRIDE - 1) / 2
    order = np.argsort(-(labels[:, 5:7] - labels[:, 3:5]).prod(axis=1)) if len(labels) else []
    for kind, x, y, x0, y0, x1, y1, ignore in labels[order]:
        c = int(kind)
        if ignore:
            a, b = np.floor(np.array([x0, y0]) / STRIDE).astype(int) - 1
            e, f = np.ceil(np.array([x1, y1]) / STRIDE).astype(int) + 2
            weight[c, max(b, 0) : max(f, 0), max(a, 0) : max(e, 0)] = 0.0
            continue
        gx, gy = (x - middle) / STRIDE, (y - middle) / STRIDE
        side = min(x1 - x0, y1 - y0) / STRIDE
        # Where the middle of a large part is cannot be told to the cell: a broad peak, and offsets from all over it.
        sigma = float(np.clip(0.13 * side, 0.7, 2.0) if side < LARGE else np.clip(0.18 * side, 2.0, 8.0))
        reach = 1 if side < LARGE else int(0.8 * sigma)
        blob = np.exp(-((columns - gx) ** 2 + (rows - gy) ** 2) / (2 * sigma**2)).astype(np.float32)
        i, j = int(np.clip(np.round(gy), 0, h - 1)), int(np.clip(np.round(gx), 0, w - 1))
        np.maximum(heat[c], blob, out=heat[c])
        heat[c, i, j] = 1.0
        sides = np.log(np.maximum([x - x0, y - y0, x1 - x, y1 - y], 1.0))
        share = 2.4 / ((2 * reach + 1) ** 2 - 1)
        for r in range(max(i - reach, 0), min(i + reach + 1, h)):
            for q in range(max(j - reach, 0), min(j + reach + 1, w)):
                if (r, q) == (i, j) or regression[6, r, q] < share:
                    regression[:, r, q] = [gx - q, gy - r, *sides, 1.0 if (r, q) == (i, j) else share]
    return heat, weight, regression
