"""What things are like by their names, and the force that follows: from a table, or from a model's words."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from tests.capabilities.perception.test_gemini import fault, service, words

from golem.capabilities.properties.base import Properties, holding_force
from golem.capabilities.properties.gemini_estimate import GeminiEstimate, GeminiEstimateConfig, read_properties
from golem.capabilities.properties.property_table import PropertyTable, PropertyTableConfig
from golem.errors import ConfigError, ServiceUnavailable

EGG = {"mass": 0.06, "friction": 0.5, "stiffness": 4000}


def test_a_tuned_force_carries_the_weight_and_does_not_crush() -> None:
    assert holding_force(Properties(0.4, 0.5, 1e5), 2.0, 0.004) == pytest.approx(2.0 * 0.4 * 9.81 / (2 * 0.5))
    assert holding_force(Properties(0.4, 0.5, 100.0), 2.0, 0.004) == pytest.approx(0.4)


def test_the_table_answers_by_name_and_a_users_rows_go_first() -> None:
    table = PropertyTable(PropertyTableConfig({"mug": (1.0, 0.3, 1e5), "vase": (0.8, 0.4, 1e5)}))
    assert table.properties("mug").mass == 1.0 and table.properties("vase").friction == 0.4
    with pytest.raises(ConfigError, match=r"Unknown thing 'teapot'; valid: .*bottle.*vase"):
        table.properties("teapot")
    with pytest.raises(ConfigError, match="The properties of vase: friction is 0, not from 0.05 to 2"):
        PropertyTable(PropertyTableConfig({"vase": (0.8, 0.0, 1e5)}))
    with pytest.raises(ValueError, match="mass is nan"):
        Properties(math.nan, 0.5, 1e5)


@pytest.fixture
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEMINI_API_KEY", "secret")
    for name in ("http_proxy", "HTTP_PROXY", "https_proxy", "HTTPS_PROXY"):
        monkeypatch.delenv(name, raising=False)


def estimate(base: str, **options: Any) -> GeminiEstimate:
    return GeminiEstimate(GeminiEstimateConfig(base=base, pause=0.0, **options), sleep=lambda _: None)


@pytest.mark.usefixtures("_key")
def test_the_model_is_asked_once_for_each_name() -> None:
    with service(lambda _: (200, words(json.dumps(EGG)))) as (base, asked):
        source = estimate(base)
        assert source.properties("raw_egg") == source.properties("raw_egg") == Properties(0.06, 0.5, 4000.0)
        source.properties("mug")
    assert len(asked) == source.asked == 2
    path, key, body = asked[0]
    (part,) = body["contents"][0]["parts"]
    assert "raw egg" in part["text"] and "stiffness" in part["text"] and key == "secret"
    assert path.endswith(":generateContent")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("It is light.", "no JSON"),
        ("[]", "no mass, friction, stiffness of the egg"),
        ('{"mass": 0.06}', "no mass, friction, stiffness of the egg"),
        ('{"mass": "light", "friction": 0.5, "stiffness": 1e4}', "no mass, friction, stiffness"),
        ('{"mass": 60, "friction": 0.5, "stiffness": 1e4}', "mass is 60, not from 0.001 to 10"),
    ],
)
def test_what_cannot_be_meant_is_a_sentence(text: str, message: str) -> None:
    with pytest.raises(ServiceUnavailable, match=message):
        read_properties(text, "egg")


@pytest.mark.usefixtures("_key")
def test_a_service_that_fails_and_a_budget_that_is_used_up() -> None:
    with service(lambda _: (429, fault("Resource exhausted."))) as (base, asked):
        with pytest.raises(ServiceUnavailable, match="quota is exhausted"):
            estimate(base).properties("egg")
        assert len(asked) == 3
    with service(lambda _: (200, words(json.dumps(EGG)))) as (base, _asked):
        source = estimate(base, calls=1)
        source.properties("egg")
        with pytest.raises(ServiceUnavailable, match="1 questions .* used up"):
            source.properties("mug")


def test_without_a_key_it_says_which_and_what_else_helps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GEMINI_API_KEY", raising=False)
    with pytest.raises(ConfigError, match="GEMINI_API_KEY.*take the table"):
        GeminiEstimate()
