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
    PushBenchConfig,
    Search,
    Trial,
    allowed,
    cells,
    run_push_bench,
    table,
)
from golem.evaluation.subject import Subject

STIFF = f"{Path(__file__).with_name('leg_methods.py')}:Stiff"
TRIAL = Trial(Subject(STIFF, "ideal"), "shove", "standing", ("front",), 40.0, 0, 0)


def search(strengths: dict[str, float], first: float, last: float = 100.0) -> dict[str, list[float]]:
    """Return the levels that are tried, by direction, on a robot that survives up to its strength in each."""
    config = PushBenchConfig(n=2, first=first, last=last, direction=tuple(strengths), phase=("standing",))
    looking = Search(config)
    tried: dict[str, list[float]] = {direction: [] for direction in strengths}
    todo = looking.first([TRIAL.subject])
    while todo:
        trial = todo.pop(0)
        for direction in trial.directions if trial.index == 0 else ():
            tried[direction].append(trial.level)
        result = {d: None if trial.level <= strengths[d] else "fall" for d in trial.directions}
        todo += looking.following(trial, result)
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
    assert search({"front": strength}, first) == {"front": tried}


def test_every_direction_is_searched_for_itself() -> None:
    assert search({"front": 25.0, "left": 65.0, "back": 500.0}, 40.0, 60.0) == {
        "front": [40, 30, 20],
        "left": [40, 50, 60],
        "back": [40, 50, 60],
    }


def test_one_of_twenty_may_be_lost_and_none_of_ten() -> None:
    assert [allowed(n) for n in (1, 10, 19, 20, 39, 40, 100)] == [0, 0, 0, 1, 1, 2, 5]


def done(level: float, index: int, **losses: str | None) -> Done:
    return Done(replace(TRIAL, directions=tuple(losses), level=level, index=index), dict(losses))


def test_the_table_says_what_was_survived_and_what_was_not_found() -> None:
    swing = replace(TRIAL, phase="left_swing", directions=("front", "left"))
    found = cells(
        [
            *(done(10.0, i, front=None, left=None) for i in range(20)),
            *(done(20.0, i, front="fall" if i < 2 else None) for i in range(20)),
            *(done(20.0, i, left="fall" if i < 1 else None) for i in range(20)),
            Done(swing, {"front": DOES_NOT_WALK, "left": DOES_NOT_WALK}),
        ]
    )
    front = next(c for c in found if c["direction"] == "front" and c["phase"] == "standing")
    assert (front["survived"], front["failed"], front["losses"]) == (10.0, 20.0, {"fall": 2})
    assert front["levels"] == [{"level": 10.0, "n": 20, "lost": 0}, {"level": 20.0, "n": 20, "lost": 2}]
    config = PushBenchConfig(
        method=(STIFF,), phase=("standing", "left_swing"), direction=("front", "left"), seed=7
    )
    text = table(found, config)
    assert "| leg_methods.py:Stiff | standing | 10 | >= 20 | 10 |" in text
    assert "| leg_methods.py:Stiff | left_swing | does not walk | does not walk | 0 |" in text
    assert "20 trials" in text and "seed 7" in text


def test_real_pushes_are_survived_and_lost_and_share_their_past() -> None:
    both = replace(TRIAL, directions=("front", "back"), level=5.0).run()
    assert both == {"front": None, "back": None}
    strong = replace(TRIAL, directions=("front", "back"), level=90.0)
    apart = {k: v for d in strong.directions for k, v in replace(strong, directions=(d,)).run().items()}
    assert strong.run() == apart and apart["back"] is not None


def test_wrong_options_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="direction 'north'"):
        run_push_bench(PushBenchConfig(direction=("north",), out=tmp_path / "run"))
    with pytest.raises(ConfigError, match="--step"):
        run_push_bench(PushBenchConfig(step=0.0, out=tmp_path / "run"))


def test_who_only_stands_is_not_asked_to_walk_again() -> None:
    walking = replace(TRIAL, phase="left_swing")
    found = walking.run()
    assert found == {"front": DOES_NOT_WALK}
    assert Search(PushBenchConfig(n=1, first=40.0)).following(walking, found) == []


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
