"""From boxes, which is all that most detectors give, to objects in space."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from golem.capabilities.perception.lift import LiftConfig, lift
from golem.types import Array, Detection, LocalizedObject, RgbdImage


@dataclass(frozen=True, slots=True)
class Box:
    """One box in an image.

    Attributes:
        label: class name.
        score: confidence, 0 to 1.
        corners: (4,) x_min, y_min, x_max, y_max [px].
    """

    label: str
    score: float
    corners: Array


def lift_boxes(frame: RgbdImage, boxes: Iterable[Box], config: LiftConfig) -> list[LocalizedObject]:
    """Return the boxes in space, best first; those outside the image, without an area or without depth are left out."""
    height, width = frame.depth.shape
    most = np.array([width - 1, height - 1, width - 1, height - 1], float)
    found: list[LocalizedObject] = []
    for box in sorted(boxes, key=lambda one: -one.score):
        corners = np.clip(np.asarray(box.corners, np.float64), 0.0, most)
        if not np.isfinite(corners).all() or (corners[2:] - corners[:2] < 1.0).any():
            continue
        detection = Detection(box.label, box.score, corners, 0.5 * (corners[:2] + corners[2:]))
        lifted = lift(frame, detection, config)
        if lifted is not None:
            found.append(lifted)
    return found
