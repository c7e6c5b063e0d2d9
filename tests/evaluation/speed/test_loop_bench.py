"""`golem bench loop`: what it prints, for one checkout and for two."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import golem
from golem.errors import ConfigError, GolemError
from golem.evaluation.speed.loop_bench import LoopBenchConfig, Worker, run_loop_bench

SOURCE = Path(golem.__file__).parents[1]


@pytest.mark.parametrize(
    ("config", "word"),
    [
        (LoopBenchConfig(stack=("dance",)), "dance"),
        (LoopBenchConfig(seconds=0.0), "--seconds"),
        (LoopBenchConfig(repetitions=0), "--repetitions"),
        (LoopBenchConfig(against=Path("nowhere")), "nowhere"),
    ],
)
def test_what_makes_no_sense_is_refused(config: LoopBenchConfig, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        run_loop_bench(config)


def test_a_process_that_ends_says_why() -> None:
    with Worker(SOURCE, "dance") as worker, pytest.raises(GolemError, match="dance"):
        worker.ask("totals", 1.0, 0)


@pytest.mark.slow
@pytest.mark.long
def test_two_checkouts_are_measured_in_turn(capsys: pytest.CaptureFixture[str]) -> None:
    config = LoopBenchConfig(("stand",), seconds=0.2, repetitions=1, against=SOURCE.parent, json=True)
    found = run_loop_bench(config)
    said = capsys.readouterr().out
    assert json.loads(said.splitlines()[-1]) == found
    one, other = found["stand"]["this"], found["stand"]["other"]
    assert one["calls"] == other["calls"]
    assert 0.0 < one["shares"][0] < 1.0 and one["rss"] > 100.0
