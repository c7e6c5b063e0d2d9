"""Google's Gemini API over HTTPS: one question, of words and images, after another, with the user's key."""

from __future__ import annotations

import base64
import json
import os
import re
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.errors import ConfigError, ServiceUnavailable, shorten
from golem.options import require

AGAIN = (408, 429, 500, 502, 503, 504)
"""Answers of a server after which asking again may help."""
QUALITY = 90
"""Of the images that are sent, as JPEG."""


@dataclass(frozen=True)
class GeminiServiceConfig:
    """How Gemini is asked.

    Attributes:
        model: name of the model, the paper's by default.
        base: address of the service.
        key: name of the environment variable that holds the key.
        timeout: time that one answer may take [s]; the paper's client waits 210 s.
        retries: how often a question is asked again that was not answered.
        pause: time before the first repetition [s]; it doubles.
        calls: questions that this module may ask in all, repetitions included.
    """

    model: str = "gemini-robotics-er-1.6-preview"
    base: str = "https://generativelanguage.googleapis.com"
    key: str = "GEMINI_API_KEY"
    timeout: float = 30.0
    retries: int = 2
    pause: float = 1.0
    calls: int = 100

    def __post_init__(self) -> None:
        require(
            "gemini ",
            ("timeout", self.timeout, 0.0 < self.timeout <= 600.0, "from 0 to 600 s"),
            ("retries", self.retries, 0 <= self.retries <= 10, "from 0 to 10"),
            ("pause", self.pause, 0.0 <= self.pause <= 60.0, "from 0 to 60 s"),
            ("calls", self.calls, self.calls >= 1, "at least 1"),
        )
        if not re.match(r"https?://[^/]", self.base):
            raise ConfigError(f"The gemini base is an address that begins with https://, not '{self.base}'.")


class GeminiService:
    """Asks the model, `asked` times so far. What it answers may differ from day to day."""

    def __init__(
        self, config: GeminiServiceConfig, who: str, instead: str, sleep: Callable[[float], None] = time.sleep
    ) -> None:
        """Take the key from the environment. Raises ConfigError: there is no key.

        Args:
            who: what needs the key, in the sentence that misses it.
            instead: what helps where there is none.
            sleep: lets time pass between two tries [s].
        """
        self._config, self._sleep = config, sleep
        self.asked = 0
        self._key = os.environ.get(config.key, "").strip()
        if not self._key:
            raise ConfigError(
                f"{who} needs a key: set the environment variable {config.key}, e.g. from "
                f"https://aistudio.google.com/apikey, or {instead}."
            )

    def ask(self, parts: Sequence[Mapping[str, Any]]) -> str:
        """Return the model's words, which are to be JSON, for `parts`; asked again where that may help.

        No thinking and a low temperature, for speed. Raises ServiceUnavailable: no answer in time, a refusal, nonsense,
        or the budget of questions is used up.
        """
        body = json.dumps(
            {
                "contents": [{"parts": list(parts)}],
                "generationConfig": {
                    "temperature": 0.1,
                    "responseMimeType": "application/json",
                    "thinkingConfig": {"thinkingBudget": 0},
                },
            }
        ).encode()
        c = self._config
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


def image_part(jpeg: bytes) -> Mapping[str, Any]:
    """Return the part of a question that shows an image."""
    return {"inline_data": {"mime_type": "image/jpeg", "data": base64.b64encode(jpeg).decode()}}


def to_jpeg(rgb: NDArray[np.uint8]) -> bytes:
    """Return an (height, width, 3) RGB image as JPEG."""
    ok, jpeg = cv2.imencode(".jpg", rgb[:, :, ::-1], [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    assert ok
    return jpeg.tobytes()


def read_json(text: str) -> Any:
    """Return the JSON of the model's words, bare or fenced, else an empty list. Raises ServiceUnavailable: not JSON."""
    fenced = re.search(r"```(?:json)?\s*(.*?)```", text, re.S)
    bare = (fenced.group(1) if fenced else text).strip()
    try:
        return json.loads(bare) if bare else []
    except ValueError as error:
        raise ServiceUnavailable(f"Gemini sent words that are no JSON: '{shorten(bare, 60)}'.") from error


def _words(raw: bytes) -> str:
    try:
        parts = json.loads(raw)["candidates"][0]["content"]["parts"]
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
