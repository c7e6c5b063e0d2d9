"""Images with labelled boxes, and the average precision of detections against them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError
from golem.types import Array, Detection


@dataclass(frozen=True, slots=True)
class LabelledImage:
    """One image.

    Attributes:
        path: its file.
        labels: (n,) class names of its boxes.
        boxes: (n, 4) x_min, y_min, x_max, y_max [px].
        ignored: numbers of the boxes that are neither asked for nor make what is found there wrong.
        crowds: those of them that hold any number of things.
        split: what the file that lists it is named after; empty where none does.
    """

    path: Path
    labels: tuple[str, ...]
    boxes: Array
    ignored: tuple[int, ...] = ()
    crowds: tuple[int, ...] = ()
    split: str = ""

    @property
    def counted(self) -> NDArray[np.bool_]:
        """(n,) whether a box is asked for."""
        counted = np.ones(len(self.labels), bool)
        counted[list(self.ignored)] = False
        return counted

    def read(self) -> NDArray[np.uint8]:
        """Return it as (height, width, 3) RGB.

        Raises:
            ConfigError: it cannot be read.
        """
        image = cv2.imread(str(self.path))
        if image is None:
            raise ConfigError(f"The image {self.path} cannot be read.")
        return np.ascontiguousarray(image[:, :, ::-1], np.uint8)


def label_of(name: str) -> str:
    """Return the label of a class as others name it: in small letters, with `_` for a space."""
    return name.lower().replace(" ", "_")


@dataclass(frozen=True, slots=True)
class LabelScore:
    """How a detector did on one class.

    Attributes:
        count: labelled boxes that are not ignored.
        ap: average precision at the given overlap (all points of the curve).
        centre: median distance of the centres of matched boxes [px]; nan without any.
        false: detections that matched nothing, not even an ignored box, per image.
    """

    count: int
    ap: float
    centre: float
    false: float


def score_label(
    label: str, images: Sequence[LabelledImage], found: Mapping[int, Sequence[Detection]], overlap: float
) -> LabelScore:
    """Return the score of one class.

    As COCO counts: what matches no box that is asked for, but one that is ignored, is neither right nor wrong. A box
    takes one detection; a crowd takes all of which it holds a share of `overlap`.

    Args:
        label: the class.
        images: the labelled images.
        found: detections of each image, by its number.
        overlap: least share of the union (IoU) that matches.
    """
    hits: list[tuple[float, bool]] = []
    off: list[float] = []
    count = 0
    for k, image in enumerate(images):
        own = np.array([name == label for name in image.labels], bool)
        boxes, counted, crowd = (image.boxes[own], image.counted[own], np.isin(np.flatnonzero(own), image.crowds))
        count += int(counted.sum())
        free = np.ones(len(boxes), bool)
        for detection in sorted((d for d in found[k] if d.label == label), key=lambda d: -d.score):
            shares = np.where(free, _shares(detection.box, boxes, crowd), 0.0)
            fits = shares >= overlap
            asked = fits & counted
            best = int(np.where(asked if asked.any() else fits, shares, -1.0).argmax()) if fits.any() else -1
            if best >= 0:
                free[best] = crowd[best]
            if asked.any():
                off.append(float(np.linalg.norm(detection.center - boxes[best].reshape(2, 2).mean(axis=0))))
            if asked.any() or not fits.any():
                hits.append((detection.score, bool(asked.any())))
    hits.sort(key=lambda one: -one[0])
    right = np.cumsum([hit for _, hit in hits]) if hits else np.zeros(0)
    precision = right / np.arange(1, len(right) + 1)
    recall = right / max(count, 1)
    # The curve never falls towards lower recall (all-point interpolation, PASCAL VOC 2010).
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    ap = float(np.sum(np.diff(np.concatenate([[0.0], recall])) * precision)) if len(right) else 0.0
    wrong = sum(not hit for _, hit in hits) / max(len(images), 1)
    return LabelScore(count, ap, float(np.median(off)) if off else float("nan"), wrong)


def _shares(box: Array, boxes: Array, crowd: NDArray[np.bool_]) -> Array:
    """Return what share of the union of `box` and each of `boxes` (n, 4) is in both; of a crowd what share of `box`."""
    low, high = np.maximum(box[:2], boxes[:, :2]), np.minimum(box[2:], boxes[:, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=1)
    own = float(np.prod(box[2:] - box[:2]))
    union = own + np.prod(boxes[:, 2:] - boxes[:, :2], axis=1) - shared
    return shared / np.maximum(np.where(crowd, own, union), 1e-9)
