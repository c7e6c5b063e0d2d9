from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from golem.errors import ConfigError
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.harness.records import TrialRecord, read_records
from golem.evaluation.metrics.compare import CompareConfig, run_compare
from golem.evaluation.metrics.statistics import PairedTable, mcnemar


@pytest.fixture
def runs(fake: Callable[..., LadderConfig]) -> tuple[Path, Path]:
    """A finished run, and a copy of it on another rung in which trials 0, 1 and 2 came out the other way."""
    first = run_ladder(fake("good", n=12)).out
    second = first.with_name("second")
    second.mkdir()

    def other(r: TrialRecord) -> TrialRecord:
        stage, module = ("grasp", "grasp_method") if r.success else ("done", None)
        turned = replace(r, success=not r.success, stage=stage, module=module) if r.index < 3 else r
        return replace(turned, rung="climb")

    lines = [other(r).line() for r in read_records(first / "trials.jsonl")]
    (second / "trials.jsonl").write_text("".join(lines))
    return first, second


def test_trials_are_paired_across_rungs(runs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    first, second = runs
    won = [r.success for r in read_records(first / "trials.jsonl")]
    lost = [r.success for r in read_records(second / "trials.jsonl")]
    (found,) = run_compare(CompareConfig(first, second)).comparisons
    table = PairedTable.count(won, lost)
    assert found.table == table and table.only_a + table.only_b == 3
    assert found.p == pytest.approx(mcnemar(table))
    assert (found.a, found.b) == ("good on fake", "good on climb")
    said = capsys.readouterr().out
    assert "The runs are of two rungs, fake and climb: the same draws in two tasks" in said
    assert "good on fake against good on climb" in said and f"{sum(won)}/12" in said and f"{sum(lost)}/12" in said


def test_runs_that_cannot_be_paired_are_refused(runs: tuple[Path, Path], fake: Callable[..., LadderConfig]) -> None:
    first, _ = runs
    with pytest.raises(ConfigError, match="holds no trials"):
        run_compare(CompareConfig(first, first.with_name("absent")))
    with pytest.raises(ConfigError, match="name two run folders"):
        run_compare(CompareConfig(first, first / ".." / first.name))
    reseeded = run_ladder(fake("good", n=1, seed=5, out="reseeded")).out
    with pytest.raises(ConfigError, match="different seeds"):
        run_compare(CompareConfig(first, reseeded))
    poor = run_ladder(fake("poor", n=1, out="poor")).out
    with pytest.raises(ConfigError, match="no method in common"):
        run_compare(CompareConfig(first, poor))


def test_whatever_else_differs_is_said(runs: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    first, second = runs
    path = second / "trials.jsonl"
    other = {"overrides": {"servo": "mine"}, "options": {"layout": "varied", "climbs": 2}}
    records = [replace(r, versions={**r.versions, "numpy": "1"}, **other) for r in read_records(path)]
    path.write_text("".join(r.line() for r in records))
    path = first / "trials.jsonl"
    path.write_text("".join(replace(r, options={"layout": "nominal"}).line() for r in read_records(path)))
    run_compare(CompareConfig(first, second))
    said = capsys.readouterr().out
    assert "different --use: none and servo=mine" in said and "different versions of numpy" in said
    assert "different --layout: nominal and varied" in said and "--climbs" not in said


def test_runs_of_different_code_are_no_comparison(runs: tuple[Path, Path]) -> None:
    first, second = runs
    path = second / "trials.jsonl"
    path.write_text("".join(replace(r, code="0", commit="older").line() for r in read_records(path)))
    with pytest.raises(ConfigError, match="are of different code, commits .* and older; measure one of them again"):
        run_compare(CompareConfig(first, second))
