"""Grounding DINO (Liu et al., ECCV 2024) by the transformers library: any words, the user's own weights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.open_words import OpenWords


class GroundingDino(OpenWords):
    """Boxes for any words; see `Localizer`.

    Each word is asked for by itself: asked together, the answers are phrases that mix them.
    """

    model = "grounding-dino", "GroundingDinoForObjectDetection", "GroundingDinoProcessor"

    def answer(self, image: NDArray[np.uint8], words: Sequence[str]) -> list[tuple[int, float, Any]]:
        import torch

        rows: list[tuple[int, float, Any]] = []
        for number, word in enumerate(words):
            given = self._processor(images=image, text=f"a {word.lower()}.", return_tensors="pt", truncation=True)
            with torch.inference_mode():
                answer = self._network(**given)
            (found,) = self._processor.post_process_grounded_object_detection(
                answer, given["input_ids"], threshold=self.config.threshold, text_threshold=self.config.threshold,
                target_sizes=[image.shape[:2]],
            )  # fmt: skip
            scores, boxes = found["scores"].tolist(), found["boxes"].numpy()
            rows += [(number, float(score), box) for score, box in zip(scores, boxes, strict=True)]
        return rows
