from __future__ import annotations

import base64
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from golem.evaluation.harness.ladder import LadderConfig, LadderResult, run_ladder
from golem.evaluation.harness.records import artefacts
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.report.ladder_report import render
from golem.evaluation.report.svg import ticks
from golem.robots.mujoco.balance import TRACE, BalanceTrace

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

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data


def read(result: LadderResult) -> tuple[str, Page]:
    html, page = result.report.read_text(encoding="utf-8"), Page()
    page.feed(html)
    assert page.open == []
    return html, page


@pytest.fixture
def compared(fake: Callable[..., LadderConfig], monkeypatch: pytest.MonkeyPatch) -> LadderResult:
    monkeypatch.setitem(PAPER, ("fake", "good"), PAPER["tether", "visual_servo"])
    return run_ladder(fake("poor", "good", "faulty", n=20))


def test_the_report_is_one_file_without_scripts(compared: LadderResult) -> None:
    html, page = read(compared)
    assert "script" not in page.seen
    assert "link" not in page.seen
    assert all(source.startswith("data:image/png;base64,") for source in page.sources)
    assert "url(" not in html


def test_the_report_says_what_was_run_and_found(compared: LadderResult) -> None:
    _, page = read(compared)
    assert compared.config.command() in page.words
    for m in compared.summary.methods:
        assert f"{100 * m.rate:.1f} %" in page.words
        assert f"{100 * m.interval.low:.1f} to {100 * m.interval.high:.1f}" in page.words
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
                data = (compared.config.out / picture).read_bytes()
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


@pytest.mark.parametrize(
    ("low", "high", "expected"),
    [
        (0, 16.7, [0, 5, 10, 15, 20]),
        (0, 0.9, [0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        (-3, 3, [-3, -2, -1, 0, 1, 2, 3]),
        (0, 0, [0, 0.2, 0.4, 0.6, 0.8, 1.0]),
    ],
)
def test_ticks_are_round_and_cover_the_values(low: float, high: float, expected: list[float]) -> None:
    assert ticks(low, high) == pytest.approx(expected)


def test_series_and_margins_are_shown_where_a_rung_has_them(
    fake: Callable[..., LadderConfig],
) -> None:
    result = run_ladder(fake("sure", "good", n=2))
    kept = replace(result.records[0], series={"margin_min": -0.05, "own_figure": 3.0})
    n = 100
    zeros = np.zeros((n, 3))
    t = 0.01 * np.arange(n, dtype=np.float64)
    trace = BalanceTrace(t, np.full(n, 0.1), zeros, zeros, np.zeros(n), zeros, np.ones((n, 2), bool), zeros)
    trace.save(artefacts(result.config.out, kept) / TRACE)
    html = render("golem ladder", [kept, *result.records[1:]], result.summary, result.config.out)
    page = Page()
    page.feed(html)
    assert page.open == []
    assert "least CoM margin" in page.words and "-50" in page.words and "own figure" in page.words
    assert html.count("<polyline") == 1
