"""A goal is typed as a call of Python is, by the schema of its skill alone."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Literal

import pytest

from golem.errors import ConfigError
from golem.runtime.goal_parser import parse_goal
from golem.runtime.skill_table import SkillTable
from golem.skills.spec import SkillSpec, plain, read_goal, schema_of
from golem.stack import Stack

SKILLS = SkillTable(Stack())


@dataclass(frozen=True)
class Where:
    """A place."""

    x: float = 1.0
    y: float = 2.0


@dataclass(frozen=True)
class Goal:
    """Many fields.

    Attributes:
        times: how often.
    """

    times: int
    side: Literal["left", "right"] = "left"
    fast: bool = False
    points: tuple[float, ...] = (0.5,)
    pair: tuple[int, str] = (1, "a")
    tool_name: str | None = None
    where: Where = field(default_factory=Where)


SPEC = SkillSpec("mine", "mine.py:Mine", "Do many things", json.loads(json.dumps(schema_of(Goal))))


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        (["3"], {}),
        (["3", "right", "--fast", "--points", "1", "-2.5"], {"side": "right", "fast": True, "points": [1.0, -2.5]}),
        (["--times", "3", "--pair", "2", "b"], {"pair": [2, "b"]}),
        (["3", "--tool-name", "x y", "--where.y", "-1"], {"tool_name": "x y", "where": {"x": 1.0, "y": -1.0}}),
    ],
)
def test_every_kind_of_field_has_an_option_with_its_default(words: list[str], changes: dict[str, Any]) -> None:
    fields = parse_goal(SPEC, words, "golem skill mine")
    assert fields == {**plain(Goal(3)), **changes}
    assert plain(read_goal("mine", Goal, fields)) == fields


@pytest.mark.parametrize(
    "words", [["1", "-0.5", "-1e-1", "odom"], ["1", "--y=-0.5", "--yaw", "-0.1", "--frame", "odom"]]
)
def test_values_follow_the_order_of_the_fields_until_the_first_name(words: list[str]) -> None:
    fields = parse_goal(SKILLS.spec("walk"), words, "golem skill walk")
    assert fields == {"x": 1.0, "y": -0.5, "yaw": -0.1, "frame": "odom", "timeout": 60.0}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--lable", "x"], "--label"),
        (["screw", "tray", "middle"], "left"),
        (["screw", "tray", "left", "more"], "more"),
        (["--help"], "class of the object"),
    ],
)
def test_a_wrong_word_ends_the_program_with_what_would_be_right(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as end:
        parse_goal(SKILLS.spec("pick"), words, "golem skill pick")
    captured = capsys.readouterr()
    assert end.value.code == (0 if words == ["--help"] else 2)
    assert said in captured.out + captured.err


def test_a_field_that_is_an_option_of_the_command_is_named() -> None:
    with pytest.raises(ConfigError, match="field 'label' of the skill 'pick' is an option of golem x itself"):
        parse_goal(SKILLS.spec("pick"), [], "golem x", ["label"])
