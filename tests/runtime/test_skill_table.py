"""The skills of a stack are its shipped ones and its own, with the options that its file gives them."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem import registry
from golem.errors import ConfigError, ModuleFault
from golem.runtime.lockstep import build
from golem.runtime.skill_table import SkillTable
from golem.skills.pick import Pick, PickGoal
from golem.stack import Stack, parse_stack


def test_the_shipped_skills_are_there_without_being_named() -> None:
    table = SkillTable(Stack())
    assert set(table.specs) == set(registry.names(registry.SKILL))
    assert table.goal("pick", {"label": "nut"}) == PickGoal("nut")
    assert isinstance(table.make("pick"), Pick) and table.make("pick") is not table.make("pick")


def test_every_option_of_a_pick_can_be_set() -> None:
    table = SkillTable(parse_stack("skills: {pick: {force: 8, timeout: 5}, gentle: {use: pick, force: 4}}", "x"))
    pick, gentle = table.make("pick"), table.make("gentle")
    assert isinstance(pick, Pick) and isinstance(gentle, Pick)
    assert (pick._config.force, gentle._config.force) == (8.0, 4.0)
    assert (pick.timeout(PickGoal()), gentle.timeout(PickGoal())) == (5.0, 240.0)


@pytest.mark.parametrize(
    ("skills", "words"),
    [
        ("{pick: {froce: 8}}", "Unknown option of skill: pick 'froce'.*Did you mean 'force'"),
        ("{pick: {force: hard}}", "option of skill: pick 'force' is a number, not 'hard'"),
        ("{mine: {use: nowhere.py:Mine}}", "nowhere.py, which does not exist"),
    ],
)
def test_a_wrong_option_is_said_when_the_stack_is_built(skills: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        build(parse_stack(f"skills: {skills}", "x"), 0)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("class Mine: pass", "its 'Goal' is unsuitable: None is no dataclass"),
        ("class Mine:\n    Goal = dict", "dict is no dataclass"),
        (
            "from dataclasses import dataclass\n@dataclass\nclass G:\n    x: 'Nowhere'\nclass Mine:\n    Goal = G",
            "its 'Goal' is unsuitable: name 'Nowhere' is not defined",
        ),
        (
            "from dataclasses import dataclass\n@dataclass\nclass G:\n    x: int = 0\nclass Mine:\n    Goal = G",
            "it lacks run of the contract Routine",
        ),
    ],
)
def test_a_class_that_is_no_skill_is_named_with_what_it_lacks(source: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(source)
    with pytest.raises(ModuleFault) as fault:
        SkillTable(parse_stack(f"skills: {{mine: '{tmp_path / 'mine.py'}:Mine'}}", "x"))
    assert words in str(fault.value)
