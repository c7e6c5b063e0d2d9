"""Gemini as a localizer: boxes of anything that words name, asked for over HTTPS, with the user's key.

The paper's format: JSON of `{"box_2d": [y_min, x_min, y_max, x_max], "label": ...}`, integers from 0 to 1000 of the
image's height and width, origin at the top left.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np

from golem.capabilities.perception.gemini_service import (
    GeminiService,
    GeminiServiceConfig,
    image_part,
    read_json,
    to_jpeg,
)
from golem.capabilities.perception.lift import Box, LiftConfig, lift_boxes
from golem.types import LocalizedObject, RgbdImage

SCALE = 1000.0
"""What the model calls the full height and width of an image."""
SCORE = 0.9
"""Confidence of what the model names; it gives none itself."""


@dataclass(frozen=True)
class GeminiConfig(GeminiServiceConfig):
    """Options of `Gemini`; see `GeminiServiceConfig`, and these.

    Attributes:
        latency: declared time per frame [s].
        lift: how depth is read.
    """

    latency: float = 3.0
    lift: LiftConfig = field(default_factory=LiftConfig)


class Gemini:
    """Objects of any name, by one question per frame; see `Localizer`. What it answers may differ from day to day."""

    def __init__(self, config: GeminiConfig | None = None, sleep: Callable[[float], None] = time.sleep) -> None:
        """Take the key from the environment. Raises ConfigError: there is none."""
        self.config = config or GeminiConfig()
        self.latency = self.config.latency
        self._service = GeminiService(self.config, "The localizer gemini", "choose another localizer", sleep)

    @property
    def asked(self) -> int:
        """Questions asked so far."""
        return self._service.asked

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        """Return what the model sees of `labels`; see `Localizer`.

        Raises ServiceUnavailable: no answer in time, a refusal, nonsense, or the budget of questions is used up.
        """
        if not labels or not (np.isfinite(frame.depth) & (frame.depth > 0.0)).any():
            return []
        said = self._service.ask((image_part(to_jpeg(frame.rgb)), {"text": _question(labels)}))
        return lift_boxes(frame, read_boxes(said, labels, frame.rgb.shape[:2]), self.config.lift)


def _question(labels: Sequence[str]) -> str:
    wanted = ", ".join(label.replace("_", " ") for label in labels)
    return (
        f"Find every {wanted} in the image. Answer with a JSON list and nothing else; each entry is "
        '{"box_2d": [ymin, xmin, ymax, xmax], "label": NAME} with integers from 0 to 1000 and one of these names as '
        "NAME. Answer [] where there is none."
    )


def read_boxes(text: str, labels: Sequence[str], size: tuple[int, int]) -> list[Box]:
    """Return the boxes that the model's words hold: JSON, bare or fenced, a list or one object.

    Entries of other labels, and those that are no box within the image, of height and width `size` [px], are left out.
    Raises ServiceUnavailable: they hold no JSON.
    """
    said = read_json(text)
    entries = cast("list[Any]", said if isinstance(said, list) else [said])
    asked = {_plain(label): label for label in labels}
    found = [_box(entry, asked, size) for entry in entries if isinstance(entry, Mapping)]
    return [box for box in found if box is not None]


def _box(entry: Mapping[str, Any], asked: Mapping[str, str], size: tuple[int, int]) -> Box | None:
    label = asked.get(_plain(str(entry.get("label", ""))))
    if label is None and len(asked) == 1 and "label" not in entry:
        (label,) = asked.values()
    sides = entry.get("box_2d")
    if label is None or not isinstance(sides, list | tuple) or len(sides) != 4:
        return None
    if not all(isinstance(v, int | float) and not isinstance(v, bool) for v in sides):
        return None
    y0, x0, y1, x1 = (float(v) / SCALE for v in sides)
    if not (0.0 <= x0 < x1 <= 1.05 and 0.0 <= y0 < y1 <= 1.05):
        return None
    height, width = size
    return Box(label, SCORE, np.array([x0 * width, y0 * height, x1 * width, y1 * height]) - 0.5)


def _plain(label: str) -> str:
    return " ".join(re.findall(r"[a-z0-9]+", label.lower()))
