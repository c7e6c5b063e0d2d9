from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from golem.dashboard.status import BAD, GOOD, PUSHED, REACH, SPAN, balance_chart
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


def drawn(margins: BalanceTrace) -> NDArray[np.uint8]:
    picture = balance_chart(margins, SIZE)
    assert picture is not None
    return picture


def shows(picture: NDArray[np.uint8], colour: str) -> NDArray[np.bool_]:
    """Return where the picture shows `colour`, or a smoothed edge of it."""
    wanted = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
    return np.abs(picture.astype(int) - wanted).max(axis=2) < 40


def columns(picture: NDArray[np.uint8], colour: str) -> NDArray[np.intp]:
    """Return the x of the columns that show `colour`."""
    return np.flatnonzero(shows(picture, colour).any(axis=0))


def test_time_runs_to_the_right_edge_and_what_is_older_than_the_span_is_gone() -> None:
    half = columns(drawn(trace(np.full(round(0.5 * SPAN / PERIOD), 0.11))), GOOD)
    assert half.min() == pytest.approx(SIZE[0] / 2, abs=3) and half.max() >= SIZE[0] - 2
    long = columns(drawn(trace(np.full(round(3 * SPAN / PERIOD), 0.11))), GOOD)
    assert len(long) >= SIZE[0] - 2


def test_what_is_below_zero_is_red_and_below_the_middle() -> None:
    margin = np.full(round(SPAN / PERIOD), 0.5 * REACH)
    margin[: len(margin) // 2] *= -1.0
    picture = drawn(trace(margin))
    bad, good = columns(picture, BAD), columns(picture, GOOD)
    assert bad.max() == pytest.approx(SIZE[0] / 2, abs=3) and good.min() == pytest.approx(SIZE[0] / 2, abs=3)
    rows = np.flatnonzero(shows(picture, BAD).any(axis=1))
    assert rows.mean() > SIZE[1] / 2


def test_a_push_is_marked_where_it_was() -> None:
    still = trace(np.full(round(SPAN / PERIOD), 0.1))
    assert not len(columns(drawn(still), PUSHED))
    force = np.zeros((len(still.t), 3))
    force[600:620, 1] = -150.0
    marked = columns(drawn(replace(still, force=force)), PUSHED)
    assert (marked.min(), marked.max()) == (pytest.approx(0.6 * SIZE[0], abs=4), pytest.approx(0.62 * SIZE[0], abs=4))


@pytest.mark.parametrize("margin", [np.array([0.11]), np.array([-2.0, 2.0]), np.zeros(3)])
def test_short_and_extreme_traces_are_drawn(margin: Array) -> None:
    assert drawn(trace(margin)).shape == (SIZE[1], SIZE[0], 3)


def test_without_matplotlib_there_is_no_chart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert balance_chart(trace(np.zeros(3)), SIZE) is None
