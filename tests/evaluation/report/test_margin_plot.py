"""Plots of the CoM margin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.robots.mujoco.balance import PERIOD, BalanceTrace

pytest.importorskip("matplotlib", reason="the extra report is not installed")
from golem.evaluation.report.margin_plot import MarginCurve, margin_plot, push_start  # noqa: E402
from golem.evaluation.report.svg_figure import styled  # noqa: E402


def trace() -> BalanceTrace:
    t = PERIOD * np.arange(500, dtype=np.float64)
    force = np.zeros((500, 3))
    force[200:300, 1] = 40.0 * np.sin(np.pi * np.arange(100) / 100)
    margin = np.where((t > 2.5) & (t < 3.0), -0.05, 0.1)
    zeros = np.zeros((500, 3))
    return BalanceTrace(t, margin, zeros, zeros, np.zeros(500), zeros, np.ones((500, 2), bool), force)


def test_the_push_begins_where_there_is_force() -> None:
    assert push_start(trace()) == pytest.approx(2.01)
    assert push_start(replace(trace(), force=np.zeros((500, 3)))) == 0.0


def plot(*curves: MarginCurve) -> str:
    with styled():
        return margin_plot(curves, 0)


def test_a_plot_has_force_and_margin_of_every_trial_and_marks_the_lost() -> None:
    drawn = plot((trace(), True), (trace(), False))
    assert drawn.startswith("<svg") and "force [N]" in drawn and "CoM margin [mm]" in drawn
    assert drawn.count("stroke: var(--m0)") == 4 and "stroke: var(--lost)" in drawn
    won = plot((trace(), True), (trace(), True))
    assert drawn.count("var(--lost)") > won.count("var(--lost)"), "a cross ends a lost one"


def test_a_plot_without_a_push_has_no_force() -> None:
    drawn = plot((replace(trace(), force=np.zeros((500, 3))), True))
    assert drawn.count("stroke: var(--m0)") == 1 and "force" not in drawn


def test_nothing_is_drawn_of_nothing() -> None:
    assert plot() == ""
