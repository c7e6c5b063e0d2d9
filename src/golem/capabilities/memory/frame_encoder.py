"""Encoders of whole frames and of words into one space, by whose angle a memory of frames compares them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from golem.capabilities.memory.base import Observation
from golem.capabilities.memory.words import label_scores
from golem.types import Array


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
    when they are met first, up to `SIZE`.
    """

    SIZE = 256

    def __init__(self) -> None:
        """Begin without labels."""
        self._component: dict[str, int] = {}

    def frame(self, observation: Observation) -> Array:
        """Return the (d,) unit vector of a frame; zero where nothing is in it."""
        vector = np.zeros(self.SIZE)
        area = observation.frame.info.width * observation.frame.info.height
        for found in observation.objects:
            component = self._component.setdefault(found.label, len(self._component))
            if component < self.SIZE:
                sides = found.detection.box[2:] - found.detection.box[:2]
                vector[component] += found.detection.score * np.sqrt(max(float(sides.prod()), 1.0) / area)
        return _unit(vector)

    def text(self, text: str) -> Array:
        """Return the (d,) unit vector of words; zero where none of the labels met so far answers to them."""
        vector = np.zeros(self.SIZE)
        for label, score in label_scores(text, self._component).items():
            if self._component[label] < self.SIZE:
                vector[self._component[label]] = score
        return _unit(vector)


def _unit(vector: Array) -> Array:
    norm = np.linalg.norm(vector)
    return vector / norm if norm > 0.0 else vector
