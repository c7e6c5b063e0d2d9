"""Training on the user's own labelled images, in COCO's or YOLO's format."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError
from golem.evaluation.metrics.coco import LabelledImage
from golem.evaluation.metrics.yolo_labels import read_labelled
from golem.robots.sensors.streams import stream
from golem.training.detector.dataset import Dataset
from golem.training.detector.labels import MIN_SIDE
from golem.types import Array

CAMERA = "own"
"""What the camera of such images is called in tables and curves."""
HELD_OUT = ("val", "valid", "validation", "test", "held_out")
"""Folders, or files of annotations, whose images are held out; where there are none, every fifth image is, drawn by
the seed. A year after it (val2017) says nothing."""
SHARE = 0.2


def load_own(folder: Path, seed: int, width: int) -> tuple[Dataset, Dataset, tuple[str, ...]]:
    """Return the training images, the held-out ones, and the classes in the order of their numbers.

    Args:
        folder: in either format; see `read_labelled`.
        seed: draws what is held out, where no folder says it.
        width: wider images are scaled down to it [px].

    Raises:
        ConfigError: the folder is in neither format, an image is absent or broken, or all are held out.
    """
    images = read_labelled(folder)
    classes = tuple(sorted({image.labels[k] for image in images for k in np.flatnonzero(image.counted)}))
    if not classes:
        raise ConfigError(f"No image of {folder} has a label.")
    base = folder.expanduser()
    held = np.array([any(_plain(p) in HELD_OUT for p in (i.split, *i.path.relative_to(base).parts)) for i in images])
    if not held.any():
        count = round(SHARE * len(images))
        held[stream(seed, "detector/own").permutation(len(images))[: max(count, 1)]] = True
    if held.all():
        raise ConfigError(f"{folder} has {len(images)} images, and all are held out; training needs some, too.")
    splits = [Dataset([], [], [], []) for _ in range(2)]
    for image, out in zip(images, held, strict=True):
        pixels, labels = _scaled(image, classes, width)
        split = splits[int(out)]
        split.images.append(pixels)
        split.labels.append(labels)
        split.cameras.append(CAMERA)
        split.conditions.append({})
    if not any(len(labels) for labels in splits[0].labels):
        raise ConfigError(f"All labelled images of {folder} are held out; training needs some, too.")
    return splits[0], splits[1], classes


def _plain(name: str) -> str:
    return name.lower().rstrip("0123456789_-")


def _scaled(image: LabelledImage, classes: tuple[str, ...], width: int) -> tuple[NDArray[np.uint8], Array]:
    """Return an image no wider than `width`, and its labels (n, 8), columns as in `labels.COLUMNS`."""
    pixels = image.read()
    scale = min(1.0, width / pixels.shape[1])
    if scale < 1.0:
        size = (width, max(round(pixels.shape[0] * scale), 1))
        pixels = np.ascontiguousarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), np.uint8)
    # A pixel's middle is at a whole number here, its corner there.
    boxes = np.clip(image.boxes * scale, 0.0, np.tile(pixels.shape[1::-1], 2)) - 0.5
    known = np.array([label in classes for label in image.labels], bool)
    kinds = np.array([classes.index(label) if label in classes else -1 for label in image.labels], float)
    middle = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    ignored = ~image.counted | ((boxes[:, 2:] - boxes[:, :2]).min(axis=1, initial=np.inf) < MIN_SIDE)
    return pixels, np.column_stack([kinds, middle, boxes, ignored.astype(float)]).reshape(-1, 8)[known]
