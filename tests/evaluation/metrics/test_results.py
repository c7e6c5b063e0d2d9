"""Published tables come from run folders: each says what it is of."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

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


def test_a_paper_gets_rows_per_trial_tables_in_latex_and_figures(fake: Make, tmp_path: Path) -> None:
    result = run_ladder(fake("good", "poor", n=4))
    text = run_results(ResultsConfig((result.out,), tmp_path / "new" / "trials.csv", "csv", tmp_path / "figures"))
    assert (tmp_path / "new" / "trials.csv").read_text() == text
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [(row["method"], row["index"]) for row in rows[:3]] == [("good", "0"), ("poor", "0"), ("good", "1")]
    for row, record in zip(rows, result.records, strict=True):
        assert row["success"] == str(record.success) and row["stage"] == record.stage
        assert float(row["difficulty"]) == record.series["difficulty"]
        assert row["time_total"] == str(record.timings.get("total", ""))
    latex = run_results(ResultsConfig((result.out,), tmp_path / "t.tex", "latex"))
    assert latex.startswith("% Rung `fake`") and r"\begin{tabular}{l" in latex and "```" not in latex
    assert all(line.startswith(("%", "\\")) or "&" in line for line in latex.splitlines() if line)
    names = sorted(path.name for path in (tmp_path / "figures").iterdir())
    assert f"{result.out.name}-success.svg" in names and f"{result.out.name}-total.svg" in names
    for name in names:
        root = ElementTree.parse(tmp_path / "figures" / name).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert "var(" not in (tmp_path / "figures" / name).read_text()
