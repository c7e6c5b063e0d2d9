"""Option values become what the constructor's type hints ask for, or one clear sentence."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest

from golem.errors import ConfigError
from golem.options import convert_all, fill, read_yaml


@dataclass(frozen=True)
class Inner:
    tolerance: float = 0.001
    steps: int = 3


@dataclass(frozen=True)
class Outer:
    name: str
    inner: Inner = field(default_factory=Inner)
    other: Inner | None = None
    gains: tuple[float, ...] = (1.0, 2.0)
    corner: tuple[float, int] = (0.0, 0)
    words: list[str] = field(default_factory=list)
    fast: bool = False
    mode: Literal["a", "b"] = "a"
    file: Path = Path("x")
    limit: float | None = None
    kind: Literal["p", "q"] | None = None
    weights: Path | None = None
    anything: Any = None


def test_values_take_the_types_of_the_fields() -> None:
    got = fill(
        "option",
        Outer,
        {
            "name": "n",
            "inner": {"tolerance": 1},
            "other": {"steps": 7},
            "gains": [1, 2, 3],
            "corner": [1, 2],
            "words": ["a"],
            "fast": True,
            "mode": "b",
            "file": "data/x.onnx",
            "limit": 2,
            "kind": "q",
            "weights": "w.onnx",
            "anything": {"a": [1]},
        },
    )
    assert got == Outer(
        "n",
        Inner(1.0),
        Inner(steps=7),
        (1.0, 2.0, 3.0),
        (1.0, 2),
        ["a"],
        True,
        "b",
        Path("data/x.onnx"),
        2.0,
        "q",
        Path("w.onnx"),
        {"a": [1]},
    )
    assert isinstance(got.inner.tolerance, float) and isinstance(got.gains, tuple)


def test_a_dataclass_may_be_passed_as_one() -> None:
    assert fill("option", Outer, {"name": "n", "inner": Inner(5.0)}).inner == Inner(5.0)


def test_what_may_be_absent_may_be_none() -> None:
    absent = fill("option", Outer, {"name": "n", "other": None, "limit": None, "kind": None})
    assert absent.other is None and absent.limit is None and absent.kind is None


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"name": "n", "innr": {}}, ["Unknown option 'innr'", "Did you mean 'inner'?"]),
        ({"name": "n", "inner": {"tolerence": 1}}, ["key of option 'inner'", "Did you mean 'tolerance'?"]),
        ({"name": "n", "inner": 3}, ["option 'inner'", "mapping", "tolerance, steps", "3"]),
        ({"name": "n", "inner": {"steps": 1.5}}, ["key of option 'inner' 'steps'", "an integer", "1.5"]),
        ({"name": "n", "inner": {"tolerance": "small"}}, ["'tolerance'", "a number", "'small'"]),
        ({"name": "n", "inner": {"tolerance": True}}, ["'tolerance'", "a number", "True"]),
        ({"name": 3}, ["option 'name'", "a word", "3"]),
        ({"name": "n", "fast": 1}, ["option 'fast'", "true or false"]),
        ({"name": "n", "gains": 3.0}, ["option 'gains'", "a list", "3.0"]),
        ({"name": "n", "gains": [1.0, "x"]}, ["option 'gains'", "a number", "'x'"]),
        ({"name": "n", "corner": [1.0]}, ["option 'corner'", "2 values, not 1"]),
        ({"name": "n", "mode": "c"}, ["option 'mode'", "'c'", "a, b"]),
        ({"name": "n", "kind": "r"}, ["option 'kind'", "'r'", "p, q"]),
        ({"name": "n", "limit": "much"}, ["option 'limit'", "a number", "'much'"]),
        ({"name": "n", "other": 3}, ["option 'other'", "mapping", "3"]),
        ({}, ["option 'name'", "must be given"]),
    ],
)
def test_a_wrong_option_is_answered_in_one_sentence(options: dict[str, Any], words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        fill("option", Outer, options)
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert "\n" not in str(caught.value)


class Plain:
    def __init__(self, side: str, gain: float = 1.0) -> None: ...


class TakesAll:
    def __init__(self, **options: float) -> None: ...


def test_supplied_parameters_are_not_options() -> None:
    assert convert_all("option", Plain, {"gain": 2}, ["side"]) == {"gain": 2.0}
    with pytest.raises(ConfigError, match=r"Unknown option 'side'; valid: gain\."):
        convert_all("option", Plain, {"side": "left"}, ["side"])


def test_a_constructor_that_takes_any_keyword_gets_any() -> None:
    assert convert_all("option", TakesAll, {"x": 1}) == {"x": 1}


def test_a_number_with_an_exponent_needs_no_point() -> None:
    assert read_yaml("[1e-6, -2E3, 1e6f]", "x") == [1e-6, -2000.0, "1e6f"]
