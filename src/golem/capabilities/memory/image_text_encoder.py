"""SigLIP (Zhai et al., ICCV 2023) and CLIP (Radford et al., ICML 2021), by transformers, with the user's weights."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from golem.capabilities.memory.base import Observation
from golem.capabilities.perception.hub_model import load_model
from golem.errors import unknown_name
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
        """Load network and processor.

        Raises:
            MissingExtra: the extra `vision` is not installed.
            ConfigError: there is no such network, or the folder `weights` holds none.
        """
        if network not in NETWORKS:
            raise unknown_name("encoder", network, NETWORKS)
        self._model, self._processor = load_model(weights, network, *NETWORKS[network])
        self._words: OrderedDict[str, Array] = OrderedDict()

    def frame(self, observation: Observation) -> Array:
        """Return the (d,) unit vector of a frame's image."""
        given = self._processor(images=observation.frame.rgb, return_tensors="pt")
        return self._vector(self._model.get_image_features, given)

    def text(self, text: str) -> Array:
        """Return the (d,) unit vector of words."""
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
