"""The table of grasps: rows are ladders, what is absent says why, the paper's rows stand below."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from golem.errors import ConfigError
from golem.evaluation.harness import grasp_table
from golem.evaluation.harness.grasp_table import TableConfig, run_table
from golem.evaluation.harness.ladder import LadderConfig
from golem.evaluation.metrics import grasp_cells
from golem.evaluation.metrics.grasp_cells import COLUMNS, ROWS, TableColumn, TableRow, absence
from golem.evaluation.metrics.published import PAPER, PaperFigure


@pytest.fixture
def out(fake: Callable[..., LadderConfig], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    columns = (
        TableColumn("poor", "poor", paper="P"),
        TableColumn("good", "good"),
        TableColumn("only on doors", "slow", ("fridge",)),
        TableColumn("of a server", "graspgen"),
    )
    monkeypatch.setattr(grasp_table, "ROWS", (TableRow("screw", "tether", "fake"),))
    monkeypatch.setattr(grasp_table, "COLUMNS", columns)
    monkeypatch.setitem(PAPER, ("fake", "poor"), (PaperFigure("screw, real robot", 3),))
    monkeypatch.setattr(grasp_cells, "WAIT", 0.05)
    return tmp_path / "table"


def test_one_command_makes_table_page_and_ladders(out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("matplotlib", reason="the extra report is not installed")
    table = run_table(TableConfig(n=10, seed=4, out=out))
    rates = table.rates()
    ours, paper = rates.rows
    assert rates.columns == ("task", "poor (P)", "good", "only on doors", "of a server")
    assert ours[0] == "screw, tether" and ours[3:] == ("-", "-")
    assert paper == ("the paper, screw, real robot", "10.0 [3.46, 25.6]", "-", "-", "-")
    ladder = table.rows[0][1]
    assert ladder is not None and ladder.report == out / "fake" / "report.html"
    won = sum(r.success for r in ladder.records if r.method == "good")
    assert ours[2].startswith(f"{100 * won / 10:.1f} [")
    said = capsys.readouterr().out
    assert "Empty: only on doors on the screw" in said and "Empty: of a server: " in said
    assert "McNemar p" in said and "n = 10 a cell, seed 4" in said
    page = (out / "table.html").read_text(encoding="utf-8")
    assert "screw, tether: method against method" in page and 'href="fake/report.html"' in page
    assert (out / "table.md").read_text(encoding="utf-8") in said


def test_a_row_and_a_column_are_named_by_rung_and_method(out: Path) -> None:
    table = run_table(TableConfig(method=("good",), n=2, out=out))
    assert [column.method for column in table.columns] == ["good"]
    empty = run_table(TableConfig(method=("graspgen",), out=out.with_name("empty")))
    assert empty.rows[0][1] is None and len(empty.absent) == 1
    with pytest.raises(ConfigError, match="Unknown row 'kitchen'; valid: fake"):
        run_table(TableConfig(rung=("kitchen",), out=out))
    with pytest.raises(ConfigError, match="Unknown column 'luck'"):
        run_table(TableConfig(method=("luck",), out=out))


def test_every_cell_of_the_papers_table_has_its_place() -> None:
    cells = {(row.rung, column.method) for row in ROWS for column in COLUMNS if row.task in column.tasks}
    ours = {key for key in PAPER if key[0] in {row.rung for row in ROWS}}
    assert ours <= cells
    assert absence(COLUMNS[0]) is None
