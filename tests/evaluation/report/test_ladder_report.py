from __future__ import annotations

import base64
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from tests.evaluation.conftest import fakes

from golem.errors import MissingExtra
from golem.evaluation.harness.ladder import LadderConfig, LadderResult, run_ladder
from golem.evaluation.harness.records import artefacts
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.summary import summarise
from golem.evaluation.report.ladder_report import render
from golem.robots.mujoco.balance import TRACE, BalanceTrace

pytest.importorskip("matplotlib", reason="the extra report is not installed")
from golem.evaluation.report import svg_figure

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """Checks that elements nest, and collects what the page would load."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.seen: list[str] = []
        self.words = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)
        self.sources += [value or "" for name, value in attrs if name in ("src", "href")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


def read(result: LadderResult) -> tuple[str, Page]:
    assert result.report is not None
    html, page = result.report.read_text(encoding="utf-8"), Page()
    page.feed(html)
    assert page.open == []
    return html, page


@pytest.fixture(scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory) -> LadderResult:
    """A ladder that was run once, for tests that only read."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PAPER, ("fake", "good"), PAPER["tether", "visual_servo"])
        return run_ladder(fakes(patch, tmp_path_factory.mktemp("ladder"))("poor", "good", "faulty", n=20))


def test_the_report_is_one_file_without_scripts(compared: LadderResult) -> None:
    html, page = read(compared)
    assert "script" not in page.seen
    assert "link" not in page.seen
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    assert not re.search(r"url\((?!#)", html), "it loads nothing"
    assert re.search(r"fill: ?#(?!f)", html.partition("</style>")[2]) is None, "colours follow light and dark"


@pytest.mark.usefixtures("fake")  # the command asks the rung for its options
def test_the_report_says_what_was_run_and_found(compared: LadderResult) -> None:
    _, page = read(compared)
    assert compared.config.command() in page.words
    for row in compared.summary.rows:
        assert f"{100 * row.rate:.1f} %" in page.words
        assert f"[{100 * row.interval.low:.3g}, {100 * row.interval.high:.3g}]" in page.words
    assert compared.records[0].commit in page.words
    assert "paper, screw, real robot: 29/30" in page.words
    assert "upper_body: my_ik.py:MyIk (10)" in page.words


def test_a_failure_and_a_success_of_each_method_are_shown(compared: LadderResult) -> None:
    html, page = read(compared)
    for method in ("poor", "good"):
        rows = [r for r in compared.records if r.method == method]
        for success in (True, False):
            picture = next((r.picture for r in rows if r.success is success), None)
            if picture is not None:
                data = (compared.out / picture).read_bytes()
                assert base64.b64encode(data).decode() in html
    assert page.seen.count("img") >= 3


def test_what_modules_say_is_shown_as_words_not_as_markup(compared: LadderResult) -> None:
    html, page = read(compared)
    assert "<head>" not in html.partition("</head>")[2]
    assert "beside the screw <head>" in page.words


def test_a_run_of_one_method_without_failures_has_a_report(fake: Callable[..., LadderConfig]) -> None:
    _, page = read(run_ladder(fake("sure", n=2)))
    assert "No trial failed." in page.words
    assert "Paired comparison" not in page.words
    assert "How long it takes" not in page.words
    assert "What it looks like" not in page.words


def test_series_and_margins_are_shown_where_a_rung_has_them(fake: Callable[..., LadderConfig]) -> None:
    result = run_ladder(fake("sure", "good", n=2))
    kept = replace(result.records[0], series={"margin_min": -0.05, "own_figure": 3.0})
    n = 100
    zeros = np.zeros((n, 3))
    t = 0.01 * np.arange(n, dtype=np.float64)
    trace = BalanceTrace(t, np.full(n, 0.1), zeros, zeros, np.zeros(n), zeros, np.ones((n, 2), bool), zeros)
    trace.save(artefacts(result.out, kept) / TRACE)
    records = (kept, *result.records[1:])
    html = render(replace(result, records=records, summary=summarise(records, ("sure", "good"))))
    page = Page()
    page.feed(html)
    assert page.open == []
    assert "minimum CoM margin" in page.words and "-50" in page.words and "own figure" in page.words
    assert "CoM margin [mm]" in page.words


def test_a_fault_is_shown_with_its_trace_and_how_to_watch_it(fake: Callable[..., LadderConfig]) -> None:
    result = run_ladder(fake("leaves", n=2))
    _, page = read(result)
    trace = result.records[1].trace
    assert trace is not None and trace in page.words
    assert f"{result.config.command()} --show leaves-00001" in page.words


def test_the_levels_of_an_adaptive_rung_have_a_report(fake: Callable[..., LadderConfig]) -> None:
    _, page = read(run_ladder(fake(rung="climb", n=2)))
    assert "Every level, 14 rows" in page.words and "Paired comparison" not in page.words


def test_without_the_extra_the_run_ends_well_and_says_how_to_get_the_report(
    fake: Callable[..., LadderConfig], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    result = run_ladder(fake("sure", n=1))
    assert result.report is None and not (result.out / "report.html").exists()
    assert "matplotlib" in result.note and "golem-humanoid[report]" in result.note
    assert (result.out / "summary.json").exists()
    monkeypatch.setitem(sys.modules, "jinja2", None)
    with pytest.raises(MissingExtra, match="jinja2"):
        svg_figure.render_page("demo.html", {})
