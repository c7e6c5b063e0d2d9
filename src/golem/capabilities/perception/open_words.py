"""What `owlv2` and `grounding_dino` share: words in, boxes out, masks of `sam` where the user has its weights."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.perception.lift import Box, LiftConfig, lift_boxes, unproject
from golem.capabilities.perception.yolo_world import distinct
from golem.errors import ConfigError, MissingExtra
from golem.options import require
from golem.types import LocalizedObject, Mask, RgbdImage

EXTRA = "vision"


def load_model(folder: Path, kind: str, model: str, processor: str) -> tuple[Any, Any]:
    """Return a network in inference mode, and the processor that feeds it.

    Args:
        folder: as `save_pretrained` writes it: configuration, weights, tokenizer and preprocessor.
        kind: `model_type` that the configuration has to have.
        model: name of the network's class in `transformers`.

    Raises:
        MissingExtra: transformers or torch is not installed.
        ConfigError: the folder holds no such model.
    """
    try:
        import torch  # noqa: F401  (the library tells its absence late)
        import transformers  # pyright: ignore[reportMissingImports]
    except ImportError as error:
        raise MissingExtra((error.name or "transformers").partition(".")[0], EXTRA) from error
    folder = folder.expanduser()
    if not (folder / "config.json").is_file():
        raise ConfigError(
            f"{folder} holds no model: it has no config.json. Give the folder that save_pretrained wrote."
        )
    try:
        found = transformers.PretrainedConfig.get_config_dict(folder, local_files_only=True)[0].get("model_type")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{folder / 'config.json'} cannot be read as a model's configuration.") from error
    if found != kind:
        raise ConfigError(f"{folder} holds a model of type {found!r}; wanted is {kind!r}.")
    try:
        network = getattr(transformers, model).from_pretrained(folder, local_files_only=True)
        feeder = getattr(transformers, processor).from_pretrained(folder, local_files_only=True)
    except Exception as error:  # the library's errors have no common base
        text = str(error).strip().partition("\n")[0]
        raise ConfigError(f"The model in {folder} cannot be loaded: {type(error).__name__}: {text}") from error
    return network.eval(), feeder


LEAST = 8
"""Pixels with a depth below which a mask is not believed."""


class Sam:
    """Masks for boxes."""

    def __init__(self, folder: Path) -> None:
        """Load network and processor. Raises MissingExtra, ConfigError: see `load_model`."""
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
        require(
            "detector's ",
            ("threshold", self.threshold, 0.0 < self.threshold < 1.0, "between 0 and 1"),
            ("overlap", self.overlap, 0.0 < self.overlap <= 1.0, "from 0 to 1"),
        )


class OpenWords(ABC):
    """A detector that takes any words; see `Localizer`.

    Attributes:
        model: what `load_model` calls it: its kind, and the classes of network and processor.
    """

    model: tuple[str, str, str]

    def __init__(self, config: OpenWordsConfig) -> None:
        """Load the networks and their processors. Raises MissingExtra, ConfigError: see `load_model`."""
        self.config, self.latency = config, config.latency
        self._sam = None if config.sam is None else Sam(config.sam)
        self._network, self._processor = load_model(config.weights, *self.model)

    @abstractmethod
    def answer(self, image: NDArray[np.uint8], words: Sequence[str]) -> list[tuple[int, float, Any]]:
        """Return (number of the words, score, (4,) x_min, y_min, x_max, y_max [px]) of each box in an RGB image."""

    def boxes(self, image: NDArray[np.uint8], labels: Sequence[str]) -> list[Box]:
        """Return the boxes of `labels` in a (height, width, 3) RGB, best first. Raises ConfigError: one is empty."""
        asked = list(dict.fromkeys(labels))
        words = [self.config.words.get(label, label.replace("_", " ")).strip() for label in asked]
        if not all(words):
            raise ConfigError("A label to look for is empty; give a word, such as mug.")
        if not words:
            return []
        found = [(k, s, np.asarray(c, np.float64) - 0.5) for k, s, c in self.answer(image, words)]
        kept: list[Box] = []
        for number, label in enumerate(asked):
            own = [(score, corners) for k, score, corners in found if k == number and np.isfinite(corners).all()]
            if own:
                scores, corners = np.array([s for s, _ in own]), np.array([c for _, c in own])
                kept += [
                    Box(label, float(scores[i]), corners[i]) for i in distinct(corners, scores, self.config.overlap)
                ]
        return sorted(kept, key=lambda box: -box.score)

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        objects = lift_boxes(frame, self.boxes(frame.rgb, labels), self.config.lift)
        return objects if self._sam is None else self._sam.masked(frame, objects)
