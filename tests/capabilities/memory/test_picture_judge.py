"""Re-ranking by a model's eyes, against a local server that answers as the service does."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.capabilities.memory.room import look
from tests.capabilities.perception.test_gemini import service, words

from golem import registry
from golem.capabilities.memory.base import Observation
from golem.capabilities.memory.reranked import Reranked
from golem.errors import ConfigError, ServiceUnavailable


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEMINI_API_KEY", "secret")
    for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "HTTPS_PROXY"):
        monkeypatch.delenv(name, raising=False)


@contextmanager
def judged(said: Callable[[str], Any]) -> Iterator[tuple[Reranked, list[Any]]]:
    """Return a memory whose judge says `said(question)`, and what it was asked."""

    def reply(body: dict[str, Any]) -> tuple[int, bytes]:
        return 200, words(json.dumps(said(body["contents"][0]["parts"][-1]["text"])))

    with service(reply) as (base, asked):
        options = {"judge": "gemini", "gemini": {"base": base, "pause": 0.0, "calls": 5}}
        memory = registry.create("memory", "reranked", options)
        yield memory, asked
        memory.close()


def turned(observation: Observation, yaw: float) -> Observation:
    """Return a look into another direction, at the same things in the image."""
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.array([[c, -s, 0.0, 0.0], [s, c, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    frame = observation.frame
    return replace(observation, frame=replace(frame, T_odom_optical=turn @ frame.T_odom_optical))


def fill(memory: Reranked) -> None:
    """Look at two places, at the first of them once more, where the mug is gone."""
    memory.observe(look(1.0, {"mug": (1.5, 0.0, 1.2)}))
    memory.observe(turned(look(2.0, {"mug": (1.5, 0.0, 1.2)}), 2.0))
    memory.observe(look(3.0, {}))


def test_what_the_model_no_longer_sees_is_history() -> None:
    def said(question: str) -> Any:
        assert "Is there a mug in the picture?" in question
        return [{"place": 0, "then": True, "now": False}, {"place": 1, "then": True, "now": True}]

    with judged(said) as (memory, asked):
        fill(memory)
        (now,) = memory.query("mug")
        (past,) = memory.query("mug", "history")
        assert (now.evidence, now.last_seen) == ("seen", 2.0)
        assert (past.evidence, past.first_seen, past.last_seen) == ("gone", 1.0, 1.0)
        assert [p.evidence for p in memory.query("mug", "anywhere")] == ["seen", "gone"]
        assert [p.last_seen for p in memory.query("mug", "at", 1.5)] == [1.0]
    parts = asked[0][2]["contents"][0]["parts"]
    assert [part["text"] for part in parts[:8:2]] == [
        "Place 0, then (1 s):", "Place 0, now (3 s):", "Place 1, then (2 s):", "Place 1, now (2 s):",
    ]  # fmt: skip
    assert all("inline_data" in part for part in parts[1:8:2])


def test_what_is_nowhere_any_more_is_told_as_moved() -> None:
    with judged(lambda _: [{"place": k, "then": True, "now": False} for k in range(9)]) as (memory, _):
        fill(memory)
        assert {p.evidence for p in memory.query("mug")} == {"moved"}


@pytest.mark.parametrize(
    "said", [[], {}, "mug", [1], [{"place": 7, "then": True, "now": True}], [{"place": 0, "then": 1, "now": 1}]]
)
def test_what_is_no_verdict_names_no_place(said: Any) -> None:
    with judged(lambda _: said) as (memory, _):
        fill(memory)
        assert memory.query("mug") == []


def test_of_what_no_frame_resembles_the_model_is_not_asked() -> None:
    with judged(lambda _: []) as (memory, asked):
        assert memory.query("mug") == []
        fill(memory)
        assert memory.query("teapot") == [] and asked == []
        assert memory.forget("mug") > 0 and memory.query("mug") == []


def test_the_budget_of_questions_ends_and_says_so() -> None:
    with judged(lambda _: []) as (memory, _):
        fill(memory)
        for _ in range(5):
            memory.query("mug")
        with pytest.raises(ServiceUnavailable, match="The 5 questions that gemini may ask are used up"):
            memory.query("mug")


def test_options_that_do_not_go_together_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    for options, words_ in (
        ({"judge": "gemini", "proposer": "top_down_map"}, "goes with the proposer frame_index"),
        ({"judge": "gemni"}, "gemini"),
        ({"judge": "gemini", "gemini": {"pictures": 0}}, "pictures is at least 1"),
    ):
        with pytest.raises(ConfigError, match=words_):
            registry.create("memory", "reranked", options)
    monkeypatch.delenv("GEMINI_API_KEY")
    with pytest.raises(ConfigError, match="Re-ranking by gemini needs a key.*choose the judge objects"):
        registry.create("memory", "reranked", {"judge": "gemini"})
