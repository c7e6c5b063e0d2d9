"""The localizer gemini against a local server that answers as the service does, and in every wrong way."""

from __future__ import annotations

import base64
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import cv2
import numpy as np
import pytest

from golem.capabilities.perception.gemini import Gemini, GeminiConfig, read_boxes
from golem.errors import ConfigError, ServiceUnavailable
from golem.evaluation.conformance import samples

Reply = tuple[int, bytes]


@contextmanager
def service(reply: Callable[[dict[str, Any]], Reply | None]) -> Iterator[tuple[str, list[Any]]]:
    """Serve at an address; None lets the question wait."""
    asked: list[Any] = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:  # noqa: N802 - the library's name
            body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            asked.append((self.path, self.headers["x-goog-api-key"], body))
            said = reply(body)
            if said is None:
                time.sleep(0.4)
                return
            self.send_response(said[0])
            self.end_headers()
            self.wfile.write(said[1])

        def log_message(self, format: str, *args: object) -> None:
            """Say nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}", asked
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def words(text: str) -> bytes:
    return json.dumps({"candidates": [{"content": {"parts": [{"text": text}]}}]}).encode()


def fault(message: str) -> bytes:
    return json.dumps({"error": {"message": message}}).encode()


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEMINI_API_KEY", "secret")
    for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "HTTPS_PROXY"):
        monkeypatch.delenv(name, raising=False)


def gemini(base: str, **options: Any) -> Gemini:
    return Gemini(GeminiConfig(base=base, pause=0.0, **options), sleep=lambda _: None)


FRAME = samples.image(0.3)
BOX = [{"box_2d": [450, 475, 550, 525], "label": "coffee mug"}]


def test_boxes_come_into_space_and_the_question_is_the_papers() -> None:
    with service(lambda _: (200, words(json.dumps(BOX)))) as (base, asked):
        (mug,) = gemini(base).locate(FRAME, ["coffee_mug", "fridge handle"])
    assert (mug.label, mug.t) == ("coffee_mug", 0.3)
    height, width = FRAME.depth.shape
    np.testing.assert_allclose(
        mug.detection.box, [0.475 * width - 0.5, 0.45 * height - 0.5, 0.525 * width - 0.5, 0.55 * height - 0.5]
    )
    assert mug.position[2] == pytest.approx(0.3 - 0.49, abs=0.02)
    path, key, body = asked[0]
    assert path == "/v1beta/models/gemini-robotics-er-1.6-preview:generateContent" and key == "secret"
    image, text = body["contents"][0]["parts"]
    assert "coffee mug, fridge handle" in text["text"]
    jpeg = np.frombuffer(base64.b64decode(image["inline_data"]["data"]), np.uint8)
    decoded = cv2.imdecode(jpeg, cv2.IMREAD_COLOR)
    assert decoded is not None and decoded.shape == FRAME.rgb.shape
    assert body["generationConfig"]["thinkingConfig"] == {"thinkingBudget": 0}


@pytest.mark.parametrize(
    ("text", "count"),
    [
        ("[]", 0),
        ("", 0),
        ('```json\n[{"box_2d": [1, 2, 30, 40], "label": "mug"}]\n```', 1),
        ('Here you are:\n```\n{"box_2d": [1, 2, 30, 40], "label": "Mug"}\n```', 1),
        ('{"box_2d": [1, 2, 30, 40]}', 1),
        ('[{"box_2d": [1, 2, 30, 40], "label": "spoon"}]', 0),
        ('[{"box_2d": [30, 2, 1, 40], "label": "mug"}, {"box_2d": [0, 0, 1500, 10], "label": "mug"}]', 0),
        ('[{"box_2d": [1, 2, 3], "label": "mug"}, {"box_2d": "all", "label": "mug"}, 7, null]', 0),
        ('[{"box_2d": [1, 2, 30, 40], "label": "mug"}, {"box_2d": [5, 6, 70, 80], "label": "mug"}]', 2),
    ],
)
def test_words_are_read_whatever_surrounds_them(text: str, count: int) -> None:
    assert len(read_boxes(text, ["mug"], (480, 640))) == count


def test_words_without_json_are_a_sentence() -> None:
    with pytest.raises(ServiceUnavailable, match="no JSON: 'I see a mug"):
        read_boxes("I see a mug.", ["mug"], (480, 640))


@pytest.mark.parametrize(
    ("reply", "message", "questions"),
    [
        ((503, fault("overloaded")), "answered 503: overloaded, 3 times", 3),
        ((429, fault("Resource exhausted.")), "quota is exhausted", 3),
        ((403, fault("API key not valid.")), "refuses the key in GEMINI_API_KEY: API key not valid", 1),
        ((404, fault("no such model")), "answered 404: no such model", 1),
        ((500, b"<html>"), "answered 500", 3),
        ((200, b"\x00\x01"), "2 bytes without an answer", 1),
        ((200, b'{"promptFeedback": {"blockReason": "SAFETY"}}'), "SAFETY", 1),
        (None, "no answer within 0.1 s, 3 times|cannot be reached", 3),
    ],
)
def test_a_wrong_answer_is_a_sentence(reply: Reply | None, message: str, questions: int) -> None:
    with service(lambda _: reply) as (base, asked):
        module = gemini(base, timeout=0.1 if reply is None else 5.0)
        with pytest.raises(ServiceUnavailable, match=message) as said:
            module.locate(FRAME, ["mug"])
    assert "secret" not in str(said.value)
    assert len(asked) == module.asked == questions


def test_what_fails_once_is_asked_again() -> None:
    replies = iter([(503, fault("busy")), (200, words("[]"))])
    with service(lambda _: next(replies)) as (base, asked):
        assert gemini(base).locate(FRAME, ["mug"]) == []
    assert len(asked) == 2


def test_the_budget_of_questions_ends() -> None:
    with service(lambda _: (200, words("[]"))) as (base, asked):
        module = gemini(base, calls=2)
        module.locate(FRAME, ["mug"])
        module.locate(FRAME, ["mug"])
        with pytest.raises(ServiceUnavailable, match="The 2 questions that gemini may ask are used up"):
            module.locate(FRAME, ["mug"])
    assert len(asked) == 2


def test_nobody_there_is_a_sentence() -> None:
    with service(lambda _: None) as (base, _):
        pass
    with pytest.raises(ServiceUnavailable, match="cannot be reached"):
        gemini(base).locate(FRAME, ["mug"])


def test_nothing_is_asked_for_nothing() -> None:
    module = gemini("http://127.0.0.1:9")
    assert module.locate(FRAME, []) == [] and module.asked == 0


def test_without_a_key_it_says_which(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GEMINI_API_KEY")
    with pytest.raises(ConfigError, match="set the environment variable GEMINI_API_KEY"):
        Gemini()
    with pytest.raises(ConfigError, match="address that begins"):
        GeminiConfig(base="example.com")
