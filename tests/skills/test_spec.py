"""What a goal consists of travels as a schema, and comes back as a goal or as one sentence."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem import registry
from golem.errors import ConfigError, ModuleFault
from golem.skills.pick import PickGoal
from golem.skills.spec import MAX_TEXT, plain, read_goal, schema_of, summary, with_ranges
from golem.skills.walk import WalkGoal


@dataclass(frozen=True)
class Box:
    """A box.

    Attributes:
        size: along x and y [m].
    """

    size: tuple[float, float] = (1.0, 2.0)


@dataclass(frozen=True)
class Everything:
    """One field of each kind.

    Attributes:
        count, weight: two numbers,
            described on two lines.
    """

    count: int
    weight: float = 0.5
    flag: bool = True
    word: str = "a"
    file: Path = Path("x")
    side: Literal["left", "right"] = "left"
    many: tuple[float, ...] = (1.0,)
    names: list[str] = field(default_factory=lambda: ["n"])
    maybe: float | None = None
    box: Box = field(default_factory=Box)


def test_every_kind_of_field_has_a_schema_with_its_default_and_its_note() -> None:
    schema = schema_of(Everything)
    fields = schema["properties"]
    assert schema["required"] == ["count"] and schema["description"] == "One field of each kind"
    assert fields["count"] == {"type": "integer", "description": "two numbers, described on two lines."}
    assert fields["weight"]["description"] == fields["count"]["description"]
    assert fields["side"] == {"enum": ["left", "right"], "default": "left"}
    assert fields["maybe"] == {"anyOf": [{"type": "number"}, {"type": "null"}], "default": None}
    assert fields["box"]["properties"]["size"]["default"] == [1.0, 2.0]
    assert json.loads(json.dumps(schema)) == schema


@given(
    st.builds(
        Everything,
        st.integers(-(2**40), 2**40),
        st.floats(allow_nan=False, allow_infinity=False),
        st.booleans(),
        st.text(st.characters(codec="utf-8"), max_size=20),
        many=st.lists(st.floats(-1.0, 1.0), max_size=5).map(tuple),
        maybe=st.none() | st.floats(-1.0, 1.0),
        box=st.builds(Box, st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0))),
    )
)
def test_a_goal_comes_back_from_json_as_it_was(goal: Everything) -> None:
    assert read_goal("all", Everything, json.loads(json.dumps(plain(goal)))) == goal


@pytest.mark.parametrize("skill", registry.names(registry.SKILL))
def test_the_shipped_skills_describe_every_field_of_their_goals(skill: str) -> None:
    cls = registry.load(registry.SKILL, skill)
    assert summary(cls)
    assert all("description" in of for of in schema_of(cls.Goal)["properties"].values())


NESTED: Any = []
for _ in range(30):
    NESTED = [NESTED]


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        (
            {"lable": "x"},
            "Unknown goal field of pick 'lable'; valid: avoid, container, container_at, label, landmarks, level, "
            "off, side, wanted. Did you mean 'label'",
        ),
        ({"label": 3}, "'label' is a word, not 3"),
        ({"side": "middle"}, "'middle'; valid: either, left, right"),
        ({"side": ["left"]}, "valid: either, left, right"),
        ({"label": ""}, "A pick names the class"),
        ({"label": "x" * 10_000_000}, f"10000000 characters; at most {MAX_TEXT}"),
        ({"x" * 10_000_000: 1}, "Unknown goal field of pick 'xxx"),
        ({"label": "\ud800"}, "no text that can be written as UTF-8"),
        ({"label": float("nan")}, "is a finite number"),
        ({"label": 10**400}, "is a finite number"),
        ({"label": NESTED}, "lists in one another"),
        ({"label": [0] * 100_000}, "1000 members"),
        ({"label": {"a": float("inf")}}, "is a finite number"),
        ({"label": None}, "'label' is a word, not None"),
    ],
)
def test_what_is_no_goal_is_answered_in_one_short_sentence(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ConfigError) as error:
        read_goal("pick", PickGoal, fields)
    assert words in str(error.value) and len(str(error.value)) < 300


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e400, 2**80])
def test_a_place_has_finite_coordinates(value: float) -> None:
    with pytest.raises(ConfigError, match="finite number"):
        read_goal("walk", WalkGoal, {"x": value})


def test_a_goal_whose_class_raises_is_the_skills_fault() -> None:
    @dataclass
    class Broken:
        x: float = 0.0

        def __post_init__(self) -> None:
            raise ZeroDivisionError("by zero")

    with pytest.raises(ModuleFault, match="its goal raised ZeroDivisionError"):
        read_goal("mine", Broken, {})


@dataclass
class Arrays:
    """A goal that cannot travel."""

    where: np.ndarray[Any, Any]


@pytest.mark.parametrize("kind", [Arrays, int, None])
def test_a_goal_that_cannot_travel_is_named(kind: Any) -> None:
    with pytest.raises(TypeError, match="cannot be written as JSON|is no dataclass"):
        schema_of(kind)


@dataclass(frozen=True)
class Ranged:
    """Numbers with ends."""

    whole: int
    share: float = 0.5
    time: float = 1.0
    free: float = 0.0
    words: str = "a"

    def __post_init__(self) -> None:
        if not 2 <= self.whole <= 9 or not 0.0 <= self.share <= 0.7 or self.time <= 0.0:
            raise ConfigError("No.")


def test_ranges_are_those_that_the_goal_accepts() -> None:
    schema = with_ranges(Ranged, schema_of(Ranged))["properties"]
    found = {name: {k: v for k, v in of.items() if "imum" in k} for name, of in schema.items()}
    # A sample of what has no default has to be accepted for its ends to be found; here 1 is not.
    assert found["whole"] == {}
    schema = with_ranges(Shared, schema_of(Shared))["properties"]
    found = {name: {k: v for k, v in of.items() if "imum" in k} for name, of in schema.items()}
    assert found == {
        "whole": {"minimum": 1, "maximum": 9},
        "share": {"minimum": 0.0, "maximum": 0.7},
        "time": {"exclusiveMinimum": 0.0},
        "free": {},
        "words": {},
    }


@dataclass(frozen=True)
class Shared(Ranged):
    """The same, from 1 on."""

    def __post_init__(self) -> None:
        if not 1 <= self.whole <= 9 or not 0.0 <= self.share <= 0.7 or self.time <= 0.0:
            raise ConfigError("No.")
