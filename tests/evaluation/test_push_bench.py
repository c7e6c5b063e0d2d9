"""The search for the largest push: levels, counting, the table, and two real levels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from golem.errors import ConfigError
from golem.evaluation.campaign import Done
from golem.evaluation.push_bench import (
    DOES_NOT_WALK,
    Level,
    PushBenchConfig,
    allowed,
    cells,
    following,
    run_push_bench,
    table,
)
from golem.evaluation.subject import Subject

STIFF = f"{Path(__file__).with_name('leg_methods.py')}:Stiff"
LEVEL = Level(Subject(STIFF, "ideal"), "shove", "standing", "front", 40.0, 20, 0)


def search(strength: float, first: float, last: float = 100.0) -> list[float]:
    """Return the levels that are tried on a robot that survives up to `strength`."""
    tried: list[float] = []
    todo = [replace(LEVEL, level=first)]
    while todo:
        level = todo.pop()
        tried.append(level.level)
        todo += following(level, level.level <= strength, True, first, 10.0, last)
    return tried


@pytest.mark.parametrize(
    ("strength", "first", "tried"),
    [
        (25.0, 10.0, [10, 20, 30]),
        (0.0, 10.0, [10]),
        (25.0, 50.0, [50, 40, 30, 20]),
        (55.0, 50.0, [50, 60]),
        (500.0, 90.0, [90, 100]),
    ],
    ids=["up", "too weak for any", "down", "up from the middle", "the end"],
)
def test_levels_close_in_on_the_limit(strength: float, first: float, tried: list[float]) -> None:
    assert search(strength, first) == tried


def test_one_of_twenty_may_be_lost_and_none_of_ten() -> None:
    assert [allowed(n) for n in (1, 10, 19, 20, 39, 40, 100)] == [0, 0, 0, 1, 1, 2, 5]


def result(passed: bool, trials: int = 20, **losses: int) -> dict[str, Any]:
    return {"trials": trials, "lost": sum(losses.values()), "losses": losses, "passed": passed}


def test_the_table_says_what_was_survived_and_what_was_not_found() -> None:
    left = replace(LEVEL, direction="left")
    done = [
        Done(replace(LEVEL, level=10.0), result(True)),
        Done(replace(LEVEL, level=20.0), result(False, 3, fall=2)),
        Done(replace(left, level=10.0), result(True)),
        Done(replace(left, phase="left_swing"), result(False, 2, **{DOES_NOT_WALK: 2})),
        Done(replace(LEVEL, phase="left_swing"), result(False, 2, **{DOES_NOT_WALK: 2})),
    ]
    found = cells(done)
    front = next(c for c in found if c["direction"] == "front" and c["phase"] == "standing")
    assert (front["survived"], front["failed"], front["losses"], front["trials"]) == (
        10.0,
        20.0,
        {"fall": 2},
        23,
    )
    config = PushBenchConfig(
        method=(STIFF,), phase=("standing", "left_swing"), direction=("front", "left"), seed=7
    )
    text = table(found, config)
    assert "| leg_methods.py:Stiff | standing | 10 | >= 10 | 10 |" in text
    assert "| leg_methods.py:Stiff | left_swing | does not walk | does not walk | 0 |" in text
    assert "20 trials" in text and "seed 7" in text


def test_real_levels_are_survived_and_lost() -> None:
    weak = replace(LEVEL, level=5.0, n=1).run()
    assert weak == {"trials": 1, "lost": 0, "losses": {}, "passed": True}
    strong = replace(LEVEL, level=90.0, n=20, direction="back").run()
    assert strong["trials"] == strong["lost"] == 2, "two lost of twenty end the level"
    assert not strong["passed"] and sum(strong["losses"].values()) == 2


def test_wrong_options_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="direction 'north'"):
        run_push_bench(PushBenchConfig(direction=("north",), out=tmp_path / "run"))
    with pytest.raises(ConfigError, match="--step"):
        run_push_bench(PushBenchConfig(step=0.0, out=tmp_path / "run"))


def test_who_only_stands_is_not_asked_to_walk_again() -> None:
    walking = replace(LEVEL, phase="left_swing", level=5.0, n=1)
    assert walking.run()["losses"] == {DOES_NOT_WALK: 1}
    assert following(walking, False, False, 5.0, 1.0, 10.0) == []


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"seed": -1}, "--seed"),
        ({"first": 50.0, "last": 20.0}, "--last"),
        ({"direction": ("left", "left")}, "--direction"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(change: dict[str, Any], word: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=word):
        run_push_bench(replace(PushBenchConfig(out=tmp_path / "run"), **change))
