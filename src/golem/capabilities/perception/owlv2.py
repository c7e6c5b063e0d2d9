"""OWLv2 (Minderer et al., NeurIPS 2023) by the transformers library: any words, the user's own weights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.open_words import OpenWords


class Owlv2(OpenWords):
    """Boxes for any words; see `Localizer`."""

    model = "owlv2", "Owlv2ForObjectDetection", "Owlv2Processor"

    def answer(self, image: NDArray[np.uint8], words: Sequence[str]) -> list[tuple[int, float, Any]]:
        import torch

        given = self._processor(
            text=[[f"a photo of a {word}" for word in words]], images=image, return_tensors="pt",
            padding="max_length", truncation=True,
        )  # fmt: skip
        with torch.inference_mode():
            answer = self._network(**given)
        (found,) = self._processor.post_process_grounded_object_detection(
            answer, threshold=self.config.threshold, target_sizes=[image.shape[:2]]
        )
        rows = zip(found["labels"].tolist(), found["scores"].tolist(), found["boxes"].numpy(), strict=True)
        return [(int(k), float(score), box) for k, score, box in rows]
