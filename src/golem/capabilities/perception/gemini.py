"""Gemini as a localizer: boxes of anything that words name, asked for over HTTPS, with the user's key.

The paper's format: JSON of `{"box_2d": [y_min, x_min, y_max, x_max], "label": ...}`, integers from 0 to 1000 of the
image's height and width, origin at the top left; no thinking and a low temperature, for speed.
"""

from __future__ import annotations

import base64
import json
import os
import re
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import cv2
import numpy as np

from golem.capabilities.perception.boxes import Box, lift_boxes
from golem.capabilities.perception.lift import LiftConfig
from golem.errors import ConfigError, ServiceUnavailable, shorten
from golem.options import require
from golem.types import LocalizedObject, RgbdImage

SCALE = 1000.0
"""What the model calls the full height and width of an image."""
AGAIN = (408, 429, 500, 502, 503, 504)
"""Answers of a server after which asking again may help."""
SCORE = 0.9
"""Confidence of what the model names; it gives none itself."""


@dataclass(frozen=True)
class GeminiConfig:
    """Options of `Gemini`.

    Attributes:
        model: name of the model, the paper's by default.
        base: address of the service.
        key: name of the environment variable that holds the key.
        timeout: time that one answer may take [s]; the paper's client waits 210 s.
        retries: how often a question is asked again that was not answered.
        pause: time before the first repetition [s]; it doubles.
        calls: questions that this module may ask in all, repetitions included.
        latency: declared time per frame [s].
        lift: how depth is read.
    """

    model: str = "gemini-robotics-er-1.6-preview"
    base: str = "https://generativelanguage.googleapis.com"
    key: str = "GEMINI_API_KEY"
    timeout: float = 30.0
    retries: int = 2
    pause: float = 1.0
    calls: int = 100
    latency: float = 3.0
    lift: LiftConfig = field(default_factory=LiftConfig)

    def __post_init__(self) -> None:
        """Check the numbers and the address.

        Raises:
            ConfigError: one of them cannot be meant.
        """
        require(
            "gemini ",
            ("timeout", self.timeout, 0.0 < self.timeout <= 600.0, "from 0 to 600 s"),
            ("retries", self.retries, 0 <= self.retries <= 10, "from 0 to 10"),
            ("pause", self.pause, 0.0 <= self.pause <= 60.0, "from 0 to 60 s"),
            ("calls", self.calls, self.calls >= 1, "at least 1"),
        )
        if not re.match(r"https?://[^/]", self.base):
            raise ConfigError(f"The gemini base is an address that begins with https://, not '{self.base}'.")


class Gemini:
    """Objects of any name, by one question per frame; see `Localizer`. What it answers may differ from day to day.

    Attributes:
        config: its options.
        latency: declared time per frame [s].
        asked: questions asked so far.
    """

    def __init__(
        self, config: GeminiConfig | None = None, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        """Take the key from the environment.

        Raises:
            ConfigError: there is none.
        """
        self.config = config or GeminiConfig()
        self.latency = self.config.latency
        self.asked = 0
        self._sleep = sleep
        self._key = os.environ.get(self.config.key, "").strip()
        if not self._key:
            raise ConfigError(
                f"The localizer gemini needs a key: set the environment variable {self.config.key}, e.g. from "
                "https://aistudio.google.com/apikey, or choose another localizer."
            )

    def locate(self, frame: RgbdImage, labels: Sequence[str]) -> list[LocalizedObject]:
        """Return what the model sees of `labels`; see `Localizer`.

        Raises:
            ServiceUnavailable: no answer in time, a refusal, nonsense, or the budget of questions is used up.
        """
        if not labels or not (np.isfinite(frame.depth) & (frame.depth > 0.0)).any():
            return []
        ok, jpeg = cv2.imencode(".jpg", frame.rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, 90])
        assert ok
        body = {
            "contents": [
                {
                    "parts": [
                        {
                            "inline_data": {
                                "mime_type": "image/jpeg",
                                "data": base64.b64encode(jpeg.tobytes()).decode(),
                            }
                        },
                        {"text": _question(labels)},
                    ]
                }
            ],
            "generationConfig": {
                "temperature": 0.1,
                "responseMimeType": "application/json",
                "thinkingConfig": {"thinkingBudget": 0},
            },
        }
        boxes = read_boxes(self._ask(json.dumps(body).encode()), labels, frame.rgb.shape[:2])
        return lift_boxes(frame, boxes, self.config.lift)

    def _ask(self, body: bytes) -> str:
        """Return the model's words, asked again where that may help."""
        c = self.config
        url = f"{c.base.rstrip('/')}/v1beta/models/{c.model}:generateContent"
        said = ""
        for k in range(c.retries + 1):
            if self.asked >= c.calls:
                raise ServiceUnavailable(
                    f"The {c.calls} questions that gemini may ask are used up; its option 'calls' allows more."
                )
            if k:
                self._sleep(c.pause * 2 ** (k - 1))
            self.asked += 1
            headers = {"Content-Type": "application/json", "x-goog-api-key": self._key}
            request = urllib.request.Request(url, body, headers)
            try:
                with urllib.request.urlopen(request, timeout=c.timeout) as answer:
                    return _words(answer.read())
            except urllib.error.HTTPError as error:
                reason = _reason(error)  # it can be read once
                said = f"answered {error.code}: {reason}"
                if error.code in (401, 403):
                    raise ServiceUnavailable(f"Gemini refuses the key in {c.key}: {reason}.") from error
                if error.code not in AGAIN:
                    raise ServiceUnavailable(f"Gemini {said}.") from error
                if error.code == 429:
                    said = f"says that the quota is exhausted ({reason})"
            except TimeoutError:
                said = f"gave no answer within {c.timeout:g} s"
            except (urllib.error.URLError, ConnectionError, OSError) as error:
                cause = getattr(error, "reason", error)
                if isinstance(cause, TimeoutError):
                    said = f"gave no answer within {c.timeout:g} s"
                else:
                    said = f"cannot be reached at {c.base} ({shorten(str(cause))})"
        raise ServiceUnavailable(f"Gemini {said}, {c.retries + 1} times.")


def _question(labels: Sequence[str]) -> str:
    wanted = ", ".join(label.replace("_", " ") for label in labels)
    return (
        f"Find every {wanted} in the image. Answer with a JSON list and nothing else; each entry is "
        '{"box_2d": [ymin, xmin, ymax, xmax], "label": NAME} with integers from 0 to 1000 and one of these names as '
        "NAME. Answer [] where there is none."
    )


def _words(raw: bytes) -> str:
    """Return the text of an answer of the service."""
    try:
        answer = json.loads(raw)
        parts = answer["candidates"][0]["content"]["parts"]
        return "".join(part.get("text", "") for part in parts)
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        blocked = re.search(rb'"(?:blockReason|finishReason)"\s*:\s*"(\w+)"', raw)
        why = f" ({blocked.group(1).decode()})" if blocked else ""
        raise ServiceUnavailable(f"Gemini sent {len(raw)} bytes without an answer{why}.") from error


def _reason(error: urllib.error.HTTPError) -> str:
    try:
        return shorten(str(json.loads(error.read())["error"]["message"]).rstrip("."))
    except (ValueError, KeyError, TypeError, OSError):
        return str(error.reason)


def read_boxes(text: str, labels: Sequence[str], size: tuple[int, int]) -> list[Box]:
    """Return the boxes that the model's words hold: JSON, bare or fenced, a list or one object.

    Entries of other labels, and those that are no box within the image, are left out.

    Args:
        text: its words.
        labels: what was asked for.
        size: height and width of the image [px].

    Raises:
        ServiceUnavailable: they hold no JSON.
    """
    fenced = re.search(r"```(?:json)?\s*(.*?)```", text, re.S)
    bare = (fenced.group(1) if fenced else text).strip()
    try:
        said = json.loads(bare) if bare else []
    except ValueError as error:
        raise ServiceUnavailable(f"Gemini sent words that are no JSON: '{shorten(bare, 60)}'.") from error
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
