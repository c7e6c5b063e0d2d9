"""Published tables come from run folders: each says what it is of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from golem.errors import ConfigError, OutputError
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.harness.records import read_records
from golem.evaluation.metrics.results import ResultsConfig, run_results

Make = Callable[..., LadderConfig]


def test_a_table_has_rates_with_intervals_and_says_command_commit_n_seed_and_profile(
    fake: Make, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    first, second = run_ladder(fake("good", "poor", n=8)), run_ladder(fake(rung="climb", n=2, out="climb"))
    capsys.readouterr()
    text = run_results(ResultsConfig((first.out, second.out)))
    assert capsys.readouterr().out == text
    head, _, rest = text.partition("Rung `climb`")
    assert head.startswith(
        f"Rung `fake`, profile `field`, n = 8 per method, seed 0, commit `{first.records[0].commit}`:"
    )
    assert f"```sh\n{first.config.command()}\n```" in head
    row = first.summary.rows[0]
    assert f"| good   |     {row.successes}/8 |" in head
    assert f"[{100 * row.interval.low:.3g}, {100 * row.interval.high:.3g}]" in head
    assert "Paired comparison" in head and "difficulty" in head
    assert "n = 2 per method and case" in rest
    written = tmp_path / "tables.md"
    run_results(ResultsConfig((first.out, second.out), written))
    assert written.read_text() == text


def test_a_table_is_of_one_commit(fake: Make) -> None:
    result = run_ladder(fake("good", n=2))
    path = result.out / "trials.jsonl"
    one, two = read_records(path)
    path.write_text(one.line() + replace(two, commit="later").line())
    with pytest.raises(ConfigError, match="trials of 2 commits, .*later; measure again"):
        run_results(ResultsConfig((result.out,)))


def test_what_is_no_run_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="holds no trials"):
        run_results(ResultsConfig((tmp_path,)))
    with pytest.raises(ConfigError, match="at least one"):
        run_results(ResultsConfig(()))
    (tmp_path / "trials.jsonl").write_text("nonsense\n")
    with pytest.raises(OutputError, match="Line 1"):
        run_results(ResultsConfig((tmp_path,)))
