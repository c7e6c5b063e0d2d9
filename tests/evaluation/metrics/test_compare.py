from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from golem.errors import ConfigError
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.harness.records import TrialRecord, read_records
from golem.evaluation.metrics.compare import CompareConfig, run_compare
from golem.evaluation.metrics.statistics import PairedTable, mcnemar


@pytest.fixture
def runs(fake: Callable[..., LadderConfig]) -> tuple[LadderConfig, LadderConfig]:
    """A finished run, and a copy of it on another rung in which trials 0, 1 and 2 came out the other way."""
    first = fake("good", n=12)
    run_ladder(first)
    second = replace(first, out=first.out.with_name("second"))
    second.out.mkdir()

    def other(r: TrialRecord) -> TrialRecord:
        turned = replace(r, success=not r.success) if r.index < 3 else r
        return replace(turned, rung="harder")

    lines = [other(r).line() for r in read_records(first.out / "trials.jsonl")]
    (second.out / "trials.jsonl").write_text("".join(lines))
    return first, second


def test_trials_are_paired_across_rungs(
    runs: tuple[LadderConfig, LadderConfig], capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = runs
    won = [r.success for r in read_records(first.out / "trials.jsonl")]
    lost = [r.success for r in read_records(second.out / "trials.jsonl")]
    row = run_compare(CompareConfig(first.out, second.out))[0]
    table = PairedTable.count(won, lost)
    assert (row["only_first"], row["only_second"]) == (table.only_a, table.only_b)
    assert row["only_first"] + row["only_second"] == 3
    assert row["p"] == pytest.approx(mcnemar(table))
    assert row["difference"] == pytest.approx((sum(won) - sum(lost)) / 12)
    assert "fake" in capsys.readouterr().out


def test_runs_that_cannot_be_paired_are_refused(
    runs: tuple[LadderConfig, LadderConfig], fake: Callable[..., LadderConfig]
) -> None:
    first, _ = runs
    with pytest.raises(ConfigError, match="holds no trials"):
        run_compare(CompareConfig(first.out, first.out.with_name("absent")))
    reseeded = fake("good", n=1, seed=5, out="reseeded")
    run_ladder(reseeded)
    with pytest.raises(ConfigError, match="different seeds"):
        run_compare(CompareConfig(first.out, reseeded.out))
    poor = fake("poor", n=1, out="poor")
    run_ladder(poor)
    with pytest.raises(ConfigError, match="no method in common"):
        run_compare(CompareConfig(first.out, poor.out))


def test_whatever_else_differs_is_said(
    runs: tuple[LadderConfig, LadderConfig], capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = runs
    path = second.out / "trials.jsonl"
    records = [
        replace(r, overrides={"servo": "mine"}, versions={**r.versions, "numpy": "1"})
        for r in read_records(path)
    ]
    path.write_text("".join(r.line() for r in records))
    run_compare(CompareConfig(first.out, second.out))
    said = capsys.readouterr().out
    assert "different --use: none and servo=mine" in said and "different versions of numpy" in said
