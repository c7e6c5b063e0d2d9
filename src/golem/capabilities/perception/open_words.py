"""What `owlv2` and `grounding_dino` share: words in, boxes out, masks of `sam` where the user has its weights."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.boxes import Box, lift_boxes
from golem.capabilities.perception.lift import LiftConfig
from golem.capabilities.perception.sam import Sam
from golem.capabilities.perception.yolo_world import distinct
from golem.errors import ConfigError
from golem.options import require
from golem.types import LocalizedObject, RgbdImage


@dataclass(frozen=True)
class OpenWordsConfig:
    """Options of a detector that takes any words.

    Attributes:
        weights: folder of the model, as `save_pretrained` of transformers writes it.
        sam: folder of a Segment Anything model that masks what is boxed; absent: the box is all there is.
        words: label -> what the model is asked for; other labels are asked for with blanks, `bus bar` for `bus_bar`.
        threshold: smallest score of a box.
        overlap: share of two boxes' union that makes them one thing.
        latency: declared time per frame [s].
        lift: how depth is read.
    """

    weights: Path
    sam: Path | None = None
    words: dict[str, str] = field(default_factory=dict[str, str])
    threshold: float = 0.25
    overlap: float = 0.6
    latency: float = 1.0
    lift: LiftConfig = field(default_factory=LiftConfig)

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ConfigError: one of them cannot be meant.
        """
        require(
            "the detector's ",
            ("threshold", self.threshold, 0.0 < self.threshold < 1.0, "between 0 and 1"),
            ("overlap", self.overlap, 0.0 < self.overlap <= 1.0, "from 0 to 1"),
        )


class OpenWords(ABC):
    """A detector that takes any words; see `Localizer`.

    Attributes:
        config: its options.
        latency: declared time per frame [s].
    """

    def __init__(self, config: OpenWordsConfig) -> None:
        """Load the masks' network, where there is one.

        Raises:
            MissingExtra, ConfigError: see `load_model`.
        """
        self.config, self.latency = config, config.latency
        self._sam = None if config.sam is None else Sam(config.sam)

    @abstractmethod
    def answer(self, image: NDArray[np.uint8], words: Sequence[str]) -> list[tuple[int, float, Any]]:
        """Return (number of the words, score, (4,) x_min, y_min, x_max, y_max [px]) of each box in an image.

        Args:
            image: (height, width, 3) RGB.
            words: what is looked for.
        """

    def boxes(self, image: NDArray[np.uint8], labels: Sequence[str]) -> list[Box]:
        """Return the boxes of `labels` in an image, (height, width, 3) RGB, best first.

        Raises:
            ConfigError: a label is empty.
        """
        asked = list(dict.fromkeys(labels))
        words = [self.config.words.get(label, label.replace("_", " ")).strip() for label in asked]
        if not all(words):
            raise ConfigError("A label to look for is empty; give a word, such as mug.")
        if not words:
            return []
        found = [(k, s, np.asarray(c, np.float64) - 0.5) for k, s, c in self.answer(image, words)]
        kept: list[Box] = []
        for number, label in enumerate(asked):
            own = [
                (score, corners) for k, score, corners in found if k == number and np.isfinite(corners).all()
            ]
            if own:
                scores, corners = np.array([s for s, _ in own]), np.array([c for _, c in own])
                kept += [
                    Box(label, float(scores[i]), corners[i])
                    for i in distinct(corners, scores, self.config.overlap)
                ]
        return sorted(kept, key=lambda box: -box.score)

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        """Return what is seen of `labels`, any words; see `Localizer`."""
        objects = lift_boxes(frame, self.boxes(frame.rgb, labels), self.config.lift)
        return objects if self._sam is None else self._sam.masked(frame, objects)
