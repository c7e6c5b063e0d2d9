"""A memory of frames: each is one vector with a place and a time, and the nearest ones to the words answer.

After ReMEmbR (Anwar et al., 2025) without its language model: what was true once answers as well as what is true now.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from golem.capabilities.memory.base import Observation, Place, When, apart, check_observation, check_query
from golem.capabilities.memory.frame_encoder import BagOfLabels, FrameEncoder
from golem.capabilities.memory.image_text_encoder import NETWORKS, ImageTextEncoder, Network
from golem.errors import ConfigError, unknown_name
from golem.types import Array

WINDOW = 0.25
"""Share of the image's width and height, about its middle, whose median depth tells where a frame looks."""


@dataclass(frozen=True, slots=True)
class FrameIndexConfig:
    """How frames are remembered.

    Attributes:
        encoder: what compares frames with words: labels (of the localizer), or the images by siglip or clip.
        weights: folder of that network, as `save_pretrained` of transformers writes it.
        spread: places closer to a better one than this are left out of an answer [m].
        least: least similarity of an answer, 0 to 1; what separates things that are not there differs by network.
        most: most frames; the oldest are forgotten first.
    """

    encoder: Literal["labels"] | Network = "labels"
    weights: Path | None = None
    spread: float = 0.5
    least: float = 0.05
    most: int = 100_000

    def __post_init__(self) -> None:
        """Refuse what has no meaning.

        Raises:
            ConfigError: an option is out of range.
        """
        if not (self.spread >= 0.0 and 0.0 <= self.least <= 1.0 and self.most > 0):
            raise ConfigError(
                "Of frame_index, spread is at least 0, least is from 0 to 1, and most is above 0."
            )
        if self.encoder not in ("labels", *NETWORKS):
            raise unknown_name("encoder", self.encoder, ("labels", *NETWORKS))
        if (self.encoder == "labels") != (self.weights is None):
            raise ConfigError(
                f"The encoder labels has no weights, {' and '.join(NETWORKS)} need the folder of theirs: "
                "memory: {use: frame_index, encoder: siglip, weights: FOLDER}."
            )

    def create(self) -> FrameEncoder:
        """Return the encoder.

        Raises:
            MissingExtra, ConfigError: see `ImageTextEncoder`.
        """
        if self.encoder == "labels" or self.weights is None:
            return BagOfLabels()
        return ImageTextEncoder(self.encoder, self.weights)


class FrameIndex:
    """Frames by what they look like."""

    def __init__(self, config: FrameIndexConfig | None = None) -> None:
        """Remember nothing yet."""
        self._config = config or FrameIndexConfig()
        self._encoder = self._config.create()
        self._vectors: list[Array] = []
        self._matrix: Array | None = None  # (n, d) of the vectors; None since the last change
        self._places: list[Array] = []
        self._times: list[float] = []
        self.last = -math.inf

    def observe(self, observation: Observation) -> None:
        """See `Memory.observe`."""
        check_observation(observation, self.last)
        self.last = observation.frame.t
        self._vectors.append(self._encoder.frame(observation))
        self._matrix = None
        self._places.append(looked_at(observation))
        self._times.append(observation.frame.t)
        over = len(self._times) - self._config.most
        if over > 0:
            del self._vectors[:over], self._places[:over], self._times[:over]

    def query(self, text: str, when: When = "now", at: float | None = None, limit: int = 5) -> list[Place]:
        """See `Memory.query`; `when` counts for nothing but `at`, before which the frames have to be."""
        check_query(text, when, at, limit)
        wanted = self._encoder.text(text)
        if not self._times or not wanted.any():
            return []
        if self._matrix is None:
            self._matrix = np.array(self._vectors)
        similar = self._matrix @ wanted
        if when == "at" and at is not None:
            similar[np.array(self._times) > at] = 0.0
        order = np.argsort(-similar, kind="stable")
        best = order[: int(np.count_nonzero(similar >= self._config.least))]
        return apart((self._place(text, k, float(similar[k])) for k in best), self._config.spread, limit)

    def _place(self, text: str, k: int, similar: float) -> Place:
        return Place(text, self._places[k], min(similar, 1.0), self._times[k], self._times[k], "similar")

    def forget(self, text: str) -> int:
        """See `Memory.forget`: frames that are most similar to the words go."""
        check_query(text, "anywhere", None, 1)
        wanted = self._encoder.text(text)
        kept = [k for k, vector in enumerate(self._vectors) if vector @ wanted < self._config.least]
        count = len(self._vectors) - len(kept)
        self._vectors, self._matrix = [self._vectors[k] for k in kept], None
        self._places = [self._places[k] for k in kept]
        self._times = [self._times[k] for k in kept]
        return count

    def close(self) -> None:
        """See `Memory.close`."""


def looked_at(observation: Observation) -> Array:
    """Return the (3,) point at which the middle of a frame looks; the eye itself where there is no depth."""
    frame = observation.frame
    height, width = frame.depth.shape
    rows, columns = (
        slice(round(n * (0.5 - WINDOW / 2)), round(n * (0.5 + WINDOW / 2))) for n in (height, width)
    )
    window = frame.depth[rows, columns]
    valid = window[window > 0.0]
    depth = float(np.median(valid)) if len(valid) else 0.0
    return frame.T_odom_optical[:3, :3] @ (0.0, 0.0, depth) + frame.T_odom_optical[:3, 3]
