"""A memory of frames: each is one vector with a place and a time, and the nearest ones to the words answer.

After ReMEmbR (Anwar et al., 2025) without its language model: what was true once answers as well as what is true now.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

import numpy as np

from golem.capabilities.memory.base import Observation, Place, When, apart, check_observation, check_query
from golem.capabilities.memory.words import label_scores
from golem.capabilities.perception.open_words import load_model
from golem.errors import ConfigError, unknown_name
from golem.types import Array

Network = Literal["siglip", "clip"]
NETWORKS: dict[str, tuple[str, str]] = {
    "siglip": ("SiglipModel", "SiglipProcessor"),
    "clip": ("CLIPModel", "CLIPProcessor"),
}
"""Type of model -> classes of its network and its processor. SigLIP 2 of fixed size is of type `siglip`."""
assert set(NETWORKS) == set(get_args(Network))
PROMPT = "a photo of a {}"
"""What the networks were trained to tell from other words."""
WORDS = 256
"""Words whose vectors are kept."""


class ImageTextEncoder:
    """Images and words as vectors whose angle says how well they fit; see `FrameEncoder`."""

    def __init__(self, network: Network, weights: Path) -> None:
        """Load the network. Raises MissingExtra: no extra `vision`; ConfigError: no such network in `weights`."""
        if network not in NETWORKS:
            raise unknown_name("encoder", network, NETWORKS)
        self._model, self._processor = load_model(weights, network, *NETWORKS[network])
        self._words: OrderedDict[str, Array] = OrderedDict()

    def frame(self, observation: Observation) -> Array:
        given = self._processor(images=observation.frame.rgb, return_tensors="pt")
        return self._vector(self._model.get_image_features, given)

    def text(self, text: str) -> Array:
        words = " ".join(text.lower().replace("_", " ").split())
        if words not in self._words:
            given = self._processor(
                text=[PROMPT.format(words)], return_tensors="pt", padding="max_length", truncation=True
            )
            self._words[words] = self._vector(self._model.get_text_features, given)
            if len(self._words) > WORDS:
                self._words.popitem(last=False)
        return self._words[words]

    def _vector(self, features: Any, given: Any) -> Array:
        import torch

        with torch.inference_mode():
            answer = features(**given)
        found = getattr(answer, "pooler_output", answer)  # transformers 5; before, it is the vector
        vector = np.asarray(found[0].numpy(), dtype=np.float64)
        return vector / max(float(np.linalg.norm(vector)), 1e-12)


class FrameEncoder(Protocol):
    """Turns frames and words into vectors of one length; the cosine of two says how well they fit."""

    def frame(self, observation: Observation) -> Array:
        """Return the (d,) unit vector of a frame; zero where nothing can be said of it."""
        ...

    def text(self, text: str) -> Array:
        """Return the (d,) unit vector of words; zero where nothing can be said of them."""
        ...


class BagOfLabels:
    """What a localizer found in a frame, as a vector with a component for each label: no network is needed.

    A label weighs by its scores and the root of the share of the image that its boxes take. Labels get a component
    when they are met first, up to `SIZE`. See `FrameEncoder`.
    """

    SIZE = 256

    def __init__(self) -> None:
        self._component: dict[str, int] = {}

    def frame(self, observation: Observation) -> Array:
        vector = np.zeros(self.SIZE)
        area = observation.frame.info.width * observation.frame.info.height
        for found in observation.objects:
            component = self._component.setdefault(found.label, len(self._component))
            if component < self.SIZE:
                sides = found.detection.box[2:] - found.detection.box[:2]
                vector[component] += found.detection.score * np.sqrt(max(float(sides.prod()), 1.0) / area)
        return _unit(vector)

    def text(self, text: str) -> Array:
        vector = np.zeros(self.SIZE)
        for label, score in label_scores(text, self._component).items():
            if self._component[label] < self.SIZE:
                vector[self._component[label]] = score
        return _unit(vector)


def _unit(vector: Array) -> Array:
    norm = np.linalg.norm(vector)
    return vector / norm if norm > 0.0 else vector


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
        if not (self.spread >= 0.0 and 0.0 <= self.least <= 1.0 and self.most > 0):
            raise ConfigError("Of frame_index, spread is at least 0, least is from 0 to 1, and most is above 0.")
        if self.encoder not in ("labels", *NETWORKS):
            raise unknown_name("encoder", self.encoder, ("labels", *NETWORKS))
        if (self.encoder == "labels") != (self.weights is None):
            raise ConfigError(
                f"The encoder labels has no weights, {' and '.join(NETWORKS)} need the folder of theirs: "
                "memory: {use: frame_index, encoder: siglip, weights: FOLDER}."
            )

    def create(self) -> FrameEncoder:
        """Return the encoder. Raises MissingExtra, ConfigError: see `ImageTextEncoder`."""
        if self.encoder == "labels" or self.weights is None:
            return BagOfLabels()
        return ImageTextEncoder(self.encoder, self.weights)


class FrameIndex:
    """Frames by what they look like; see `Memory`."""

    def __init__(self, config: FrameIndexConfig | None = None) -> None:
        self._config = config or FrameIndexConfig()
        self._encoder = self._config.create()
        self._vectors: list[Array] = []
        self._matrix: Array | None = None  # (n, d) of the vectors; None since the last change
        self._places: list[Array] = []
        self._times: list[float] = []
        self.last = -math.inf

    def observe(self, observation: Observation) -> None:
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
        best = np.argsort(-similar, kind="stable")[: int(np.count_nonzero(similar >= self._config.least))]
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
    rows, columns = (slice(round(n * (0.5 - WINDOW / 2)), round(n * (0.5 + WINDOW / 2))) for n in (height, width))
    window = frame.depth[rows, columns]
    valid = window[window > 0.0]
    depth = float(np.median(valid)) if len(valid) else 0.0
    return frame.T_odom_optical[:3, :3] @ (0.0, 0.0, depth) + frame.T_odom_optical[:3, 3]
