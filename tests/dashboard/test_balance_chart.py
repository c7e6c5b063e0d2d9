from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from golem.dashboard.balance_chart import (
    BAD,
    GOOD,
    PUSHED,
    REACH,
    SPAN,
    balance_chart,
    balance_figures,
    balance_section,
)
from golem.robots.mujoco.balance import PERIOD, BalanceTrace
from golem.types import Array

SIZE = (320, 84)


def trace(margin: Array) -> BalanceTrace:
    n = len(margin)
    three = np.zeros((n, 3))
    return BalanceTrace(
        np.linspace(0.0, PERIOD * (n - 1), n, dtype=np.float64),
        margin,
        three,
        three,
        np.zeros(n),
        three,
        np.ones((n, 2), bool),
        three,
    )


def columns(picture: NDArray[np.uint8], colour: tuple[int, int, int]) -> NDArray[np.intp]:
    """Return the x of the columns that show `colour`."""
    return np.flatnonzero((picture == colour).all(axis=2).any(axis=0))


def test_time_runs_to_the_right_edge_and_what_is_older_than_the_span_is_gone() -> None:
    half = columns(balance_chart(trace(np.full(round(0.5 * SPAN / PERIOD), 0.11)), SIZE), GOOD)
    assert half.min() == pytest.approx(SIZE[0] / 2, abs=3) and half.max() >= SIZE[0] - 2
    long = columns(balance_chart(trace(np.full(round(3 * SPAN / PERIOD), 0.11)), SIZE), GOOD)
    assert len(long) >= SIZE[0] - 2


def test_what_is_below_zero_is_red_and_below_the_middle() -> None:
    margin = np.full(round(SPAN / PERIOD), 0.5 * REACH)
    margin[: len(margin) // 2] *= -1.0
    picture = balance_chart(trace(margin), SIZE)
    bad, good = columns(picture, BAD), columns(picture, GOOD)
    assert bad.max() == pytest.approx(SIZE[0] / 2, abs=3) and good.min() == pytest.approx(SIZE[0] / 2, abs=3)
    rows = np.flatnonzero((picture == BAD).all(axis=2).any(axis=1))
    assert rows.mean() > SIZE[1] / 2


def test_a_push_is_marked_where_it_was() -> None:
    still = trace(np.full(round(SPAN / PERIOD), 0.1))
    assert not len(columns(balance_chart(still, SIZE), PUSHED))
    force = np.zeros((len(still.t), 3))
    force[600:620, 1] = -150.0
    marked = columns(balance_chart(replace(still, force=force), SIZE), PUSHED)
    assert (marked.min(), marked.max()) == (
        pytest.approx(0.6 * SIZE[0], abs=4),
        pytest.approx(0.62 * SIZE[0], abs=4),
    )


@pytest.mark.parametrize("margin", [np.array([0.11]), np.array([-2.0, 2.0]), np.zeros(3)])
def test_short_and_extreme_traces_are_drawn(margin: Array) -> None:
    assert balance_chart(trace(margin), SIZE).shape == (SIZE[1], SIZE[0], 3)


def test_work_and_push_are_told_apart() -> None:
    margin = np.full(500, 0.1)
    margin[200:220] = -0.15
    whole = trace(margin)
    assert balance_figures(whole, None)["margin_min"] == -0.15
    figures = balance_figures(whole, 1.95)
    assert (figures["margin_min"], figures["push_margin_min"], figures["push_margin_final"]) == (
        0.1,
        -0.15,
        0.1,
    )
    page = balance_section(whole, 1.95, figures)
    assert "100 mm or more" in page and "Least margin -150 mm" in page and page.count("<svg") == 2
    assert balance_section(whole, None, balance_figures(whole, None)).count("<svg") == 1
