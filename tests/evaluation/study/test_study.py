"""Studies: one folder, resumable, refused where they mix; their plan, their tables, their site."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.harness.ladder import LadderConfig
from golem.evaluation.harness.records import Provenance, read_records
from golem.evaluation.metrics.anytime import anytime_interval
from golem.evaluation.metrics.sequential import StopRule
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.report.site import PublishConfig, _data, run_publish
from golem.evaluation.study.study_command import StudyConfig, run_study_command, simulated, smallest_difference
from golem.evaluation.study.study_file import read_study_file
from golem.evaluation.study.study_folder import CellResult, Study, read_study

pytest.importorskip("jinja2", reason="the extra report is not installed")
FILE = """
title: Good against poor
about: A study of nothing.
by_construction: Good is made to be better.
n: 5
profile: ideal
cells:
  - {rung: fake, method: [poor, good], name: first}
  - {rung: fake, method: [poor, sure], name: second}
compare: [[first, second]]
"""


@pytest.fixture
def study(fake: Callable[..., LadderConfig], tmp_path: Path) -> StudyConfig:
    (tmp_path / "few.yaml").write_text(FILE)
    return StudyConfig((tmp_path / "few.yaml",), out=tmp_path / "studies" / "few")


@pytest.fixture
def done(study: StudyConfig) -> Path:
    """The folder of the study, made without running it: its trials are copies of one ladder's."""
    found = run_study_command(study)
    assert found is not None and study.out is not None
    return study.out


@pytest.mark.slow
def test_a_study_is_one_folder_with_tables_pages_and_a_site(
    study: StudyConfig, done: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = read_study(done)
    assert [cell.name for cell in found.cells] == ["first", "second"]
    table = found.rates()
    assert table.columns == ("cell", "poor", "good", "sure")
    assert table.rows[1][2] == "-" and table.rows[1][3].startswith("100.0 [56.6, 100] (5)")
    assert "Good is made to be better." in table.note
    pairs = [row[0] for row in found.comparisons()[1].rows]
    assert pairs == ["first: poor against good", "second: poor against sure", "poor: first against second"]
    for name in ("study.md", "study.html", "trials.csv", "first/report.html"):
        assert (done / name).is_file()

    page = tmp_path / "page.md"
    page.write_text("Before.\n<!-- study: few -->\nstale words\n<!-- /study -->\nAfter.\n")
    run_study_command(StudyConfig((done.parent, page), tables=True))
    text = page.read_text()
    assert text.startswith("Before.\n<!-- study: few -->\n*Good against poor. Profile ideal, n = 5 per method")
    assert text.endswith("\n<!-- /study -->\nAfter.\n") and "stale" not in text
    assert f"golem study {study.paths[0]} --out {done}" in text and "commit `" in text

    index = run_publish(PublishConfig((done,), out=tmp_path / "site"))
    links = index.read_text()
    assert 'href="few/first/1-good.html"' in links and 'href="data/golem.bib"' in links
    trial = next((tmp_path / "site/few/first/trials").glob("good-00001.html")).read_text()
    assert "next trial" in trial and "good-00001-good-00001.png" in trial
    assert (tmp_path / "site/data/tables.tex").read_text().count("toprule") == 1
    for html in (tmp_path / "site").rglob("*.html"):
        for link in _links(html.read_text()):
            assert (html.parent / link).is_file(), f"{html} links to {link}"
    run_publish(PublishConfig((done / "first", done / "second"), out=tmp_path / "site"))

    before = {p: p.read_bytes() for p in done.rglob("timings.jsonl")}
    run_study_command(study)
    assert before == {p: p.read_bytes() for p in done.rglob("timings.jsonl")}
    capsys.readouterr()
    run_study_command(replace(study, plan=True))
    assert "Plan of Good against poor" in capsys.readouterr().out
    _bad_folders(done, tmp_path)


def _links(text: str) -> list[str]:
    import re

    return [link for link in re.findall(r'(?:href|src)="([^"]+)"', text) if not link.startswith("data:")]


def _bad_folders(done: Path, tmp_path: Path) -> None:
    """What a folder may be that nobody should publish: each is answered in one sentence."""
    trials = done / "first" / "trials.jsonl"
    whole = trials.read_text()
    site = PublishConfig((done,), out=tmp_path / "site")
    trials.write_text(whole[:-20])
    with pytest.raises(OutputError, match=r"The last line of .*trials.jsonl is half-written"):
        run_publish(site)
    trials.write_text("".join(replace(r, code="0", commit="older").line() for r in read_records_of(whole, tmp_path)))
    with pytest.raises(ConfigError, match=r"of different code, commits older .* and .*; measure one of them again"):
        run_publish(site)
    with pytest.raises(ConfigError, match="of different code"):
        run_publish(replace(site, folders=(done / "first", done / "second")))
    trials.write_text(whole)
    held = os.open(done / "first", os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_EX)
    with pytest.raises(OutputError, match="Another run is writing to"):
        run_publish(site)
    os.close(held)
    with pytest.raises(OutputError, match="holds something else than a site"):
        run_publish(replace(site, out=done))
    with pytest.raises(ConfigError, match="are called 'few'"):
        run_publish(replace(site, folders=(done, done)))
    page = tmp_path / "page.md"
    for text, sentence in (
        ("<!-- study: few -->\n", "needs lines '<!-- study: NAME -->'"),
        ("<!-- study: absent -->\n<!-- /study -->", "absent holds no trials"),
    ):
        page.write_text(text)
        with pytest.raises(GolemError, match=sentence):
            run_study_command(StudyConfig((done.parent, page), tables=True))
        assert page.read_text() == text


def read_records_of(text: str, folder: Path) -> list[Any]:
    (folder / "copy.jsonl").write_text(text)
    return read_records(folder / "copy.jsonl")


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("[poor, good]", "[poor, god]", "cell 'first': Unknown method 'god'; valid: .*Did you mean 'good'"),
        ("rung: fake,", "rung: fak,", "Unknown rung 'fak'"),
        ("profile: ideal", "profile: idle", "cell 'first': Unknown profile 'idle'"),
        ("name: second", "name: first", "Two cells are called 'first'"),
        ("name: second", "name: ../up", "names a folder"),
        ("compare: [[first, second]]", "compare: [[first, third]]", "Unknown cell 'third'"),
        ("n: 5", "m: 5", "Unknown key of the study 'm'"),
        ("n: 5", "n: five", "is an integer, not 'five'"),
        ("name: second", "name: second, layout: varied", "Unknown option of rung fake 'layout'"),
        ("name: second", "name: second, options: {skill: much}", "is a number, not 'much'"),
        ("name: second", "name: second, seed: one", "The seed of a cell is a whole number"),
        ("n: 5", "stop: sometimes", "Unknown value of key of the study 'stop' 'sometimes'"),
        ("title: Good against poor", "titel: x", "Unknown key of the study 'titel'"),
    ],
)
def test_a_study_that_cannot_be_is_refused_before_anything_is_written(
    study: StudyConfig, old: str, new: str, sentence: str
) -> None:
    study.paths[0].write_text(FILE.replace(old, new, 1))
    with pytest.raises(ConfigError, match=sentence):
        run_study_command(study)
    assert study.out is not None and not study.out.exists()


def test_values_of_an_axis_make_a_cell_each(study: StudyConfig) -> None:
    study.paths[0].write_text("title: t\nn: 3\ncells:\n  - {rung: fake, profile: [ideal, field], seed: [1, 2]}\n")
    cells = read_study_file(study.paths[0])[1]
    assert [cell.name for cell in cells] == ["fake-ideal-1", "fake-ideal-2", "fake-field-1", "fake-field-2"]
    assert [(c.config.profile, c.config.seed, c.config.n) for c in cells][3] == ("field", 2, 3)
    assert cells[0].config.method == ("poor", "good")


def test_every_study_of_the_repository_can_be_run() -> None:
    folder = Path(__file__).parents[3] / "studies"
    assert len(list(folder.glob("*.yaml"))) >= 4
    for path in folder.glob("*.yaml"):
        assert read_study_file(path)[0].by_construction, f"{path} does not say what the profile puts in"


def test_a_plan_finds_less_with_fewer_trials() -> None:
    few, many = smallest_difference(20, 1), smallest_difference(100, 1)
    assert 0.1 < many < few < 0.7
    a, b = simulated(0.2, 1000)
    assert a.mean() - b.mean() == pytest.approx(0.2, abs=0.01)


def test_the_share_of_a_search_is_not_quoted(fake: Callable[..., LadderConfig], tmp_path: Path) -> None:
    p = Provenance({"weak": {}}, {}, "abc", {})
    records = [
        p.record(TrialSpec("climb", "weak", "ideal", 0, i, case={"side": "left", "level": level}), won)
        for i in range(2)
        for level, won in ((1.0, TrialOutcome(True, "done")), (3.0, TrialOutcome(False, "fall")))
    ]
    cell = CellResult("levels", tmp_path, 2, tuple(records))
    study = Study("few", "Few", "", "", "", "never", StopRule(), (), (cell,))
    assert study.rates().rows == (("levels", "own table"),)
    assert study.pairs() == [] and study.comparisons() == []


def test_the_data_of_a_site_hold_reasons_of_several_lines(fake: object, tmp_path: Path) -> None:
    """Arrow reads a megabyte at once, which ends within a trial."""
    parquet = pytest.importorskip("pyarrow.parquet")
    lost = TrialOutcome(False, "fault", detail="It said:\n" + 700 * "no. ")
    p = Provenance({"good": {}}, {}, "abc", {})
    records = tuple(p.record(TrialSpec("fake", "good", "ideal", 0, i), lost) for i in range(500))
    study = Study("few", "Few", "", "", "", "never", StopRule(), (), (CellResult("a", tmp_path, 500, records),))
    _data([study], tmp_path)
    assert parquet.read_table(tmp_path / "data" / "trials.parquet")["detail"].to_pylist() == [lost.detail] * 500


def test_what_shares_a_scene_counts_as_one(fake: Callable[..., LadderConfig], tmp_path: Path) -> None:
    p = Provenance({"good": {}}, {}, "abc", {})
    won = TrialOutcome(True, "done")
    records = [
        p.record(TrialSpec("fake", "good", "ideal", 0, i, case={"thing": thing}), won)
        for i in range(20)
        for thing in ("mug", "bowl")
    ]
    cell = CellResult("things", tmp_path, 20, tuple(records))
    study = Study("few", "Few", "", "", "", "never", StopRule(), (), (cell,))
    assert study.success(cell, "good") == (1.0, wilson(20, 20)) and study.rates().rows[0][1] == "100.0 [83.9, 100] (40)"
    early = replace(study, stop="decided").success(cell, "good")[1]
    assert early == anytime_interval([1.0] * 20)


def test_cells_of_several_cases_are_compared_over_all_of_them(fake: object, tmp_path: Path) -> None:
    def cell(name: str, lost: str, cases: tuple[str, ...]) -> CellResult:
        p = Provenance({"good": {}}, {}, "abc", {})
        outcomes = {case: TrialOutcome(False, "fall") if case == lost else TrialOutcome(True, "done") for case in cases}
        specs = [TrialSpec("fake", "good", "ideal", 0, i, case={"on": case}) for i in range(20) for case in cases]
        return CellResult(name, tmp_path, 20, tuple(p.record(spec, outcomes[str(spec.case["on"])]) for spec in specs))

    cells = cell("a", "ice", ("ice", "floor")), cell("b", "", ("mud", "ice", "floor")), cell("c", "mud", ("mud",))
    study = Study("few", "Few", "", "", "", "never", StopRule(), (("a", "b"), ("a", "c")), cells)
    both, other = ((x.tolist(), y.tolist()) for *_, x, y, _ in study.pairs())
    assert both == ([0.5] * 20, [1.0] * 20)  # on ice and floor, which both have
    assert other == ([0.5] * 20, [0.0] * 20)


@pytest.mark.parametrize(
    "change",
    [
        {"cells": ...}, {"cells": [1]}, {"cells": {"a": "many"}}, {"compare": [["a"]]}, {"margin": "wide"},
        {"comparisons": 0}, {"stop": ...},
    ],
    ids=str,
)  # fmt: skip
def test_facts_of_a_study_that_are_none_are_refused(change: dict[str, object], tmp_path: Path) -> None:
    facts = dict.fromkeys(("name", "title", "about", "by_construction", "command", "stop", "score"), "")
    whole = {**facts, "margin": 0.1, "comparisons": 1, "compare": [], "cells": {"a": 1}}
    for said, words in ((change, "study.json is no study: .*; run the study again"), ({}, "holds no trials yet")):
        kept = {name: value for name, value in {**whole, **said}.items() if value is not ...}
        (tmp_path / "study.json").write_text(json.dumps(kept))
        with pytest.raises(ConfigError, match=words):
            read_study(tmp_path)
    for text in ("[]", "3", "null", "{"):
        (tmp_path / "study.json").write_text(text)
        with pytest.raises(ConfigError, match="study.json is no study"):
            read_study(tmp_path)
