"""Segment Anything (Kirillov et al., ICCV 2023): the pixels of what others box; the user's own weights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.hub_model import load_model
from golem.capabilities.perception.lift import unproject
from golem.types import LocalizedObject, Mask, RgbdImage

LEAST = 8
"""Pixels with a depth below which a mask is not believed."""


class Sam:
    """Masks for boxes."""

    def __init__(self, folder: Path) -> None:
        """Load network and processor.

        Raises:
            MissingExtra, ConfigError: see `load_model`.
        """
        self._network, self._processor = load_model(folder, "sam", "SamModel", "SamProcessor")

    def masked(self, frame: RgbdImage, objects: Sequence[LocalizedObject]) -> list[LocalizedObject]:
        """Return the objects with mask and points of their own pixels alone; one without a sound mask as it was."""
        if not objects:
            return []
        masks = self.masks(frame.rgb, [list(map(float, one.detection.box)) for one in objects])
        return [_with_mask(frame, one, mask) for one, mask in zip(objects, masks, strict=True)]

    def masks(self, image: NDArray[np.uint8], boxes: Sequence[Sequence[float]]) -> NDArray[np.bool_]:
        """Return (n, height, width) which pixels of `image`, (height, width, 3) RGB, are of what each box holds."""
        import torch

        given = self._processor(images=image, input_boxes=[[list(box) for box in boxes]], return_tensors="pt")
        with torch.inference_mode():
            answer = self._network(
                pixel_values=given["pixel_values"], input_boxes=given["input_boxes"], multimask_output=False
            )
        masks = self._processor.image_processor.post_process_masks(
            answer.pred_masks, given["original_sizes"], given["reshaped_input_sizes"]
        )
        return np.asarray(masks[0][:, 0], bool)


def _with_mask(frame: RgbdImage, one: LocalizedObject, pixels: NDArray[np.bool_]) -> LocalizedObject:
    """Return the object with the points of its mask; its position is the one of them that is nearest to the old one."""
    seen = pixels & np.isfinite(frame.depth) & (frame.depth > 0)
    rows, columns = np.nonzero(seen)
    if len(rows) < LEAST:
        return one
    y, x = int(rows.min()), int(columns.min())
    mask = Mask(seen[y : rows.max() + 1, x : columns.max() + 1], x, y)
    points = unproject(frame, mask)
    nearest = points[int(((points - one.position) ** 2).sum(axis=1).argmin())]
    return replace(one, position=nearest, points=points, mask=mask)
