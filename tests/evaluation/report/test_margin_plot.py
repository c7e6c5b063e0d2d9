"""Plots of the margin, and where the arrow of a push is drawn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.evaluation.episodes.film_strip import project
from golem.evaluation.report.margin_plot import MarginCurve, margin_plot, push_start
from golem.robots.mujoco.balance import PERIOD, BalanceTrace
from golem.robots.mujoco.spectator import Shot


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


def test_a_plot_has_force_and_margin_of_every_trial_and_marks_the_lost() -> None:
    plot = margin_plot([MarginCurve(trace(), True, "one"), MarginCurve(trace(), False, "two")], 0)
    assert plot.count("<polyline") == 4
    assert plot.count('class="course bold m0"') == 2
    assert plot.count("lostmark") == 2
    assert 'class="zero"' in plot and 'class="pushed"' in plot


def test_a_plot_without_a_push_has_no_force() -> None:
    plot = margin_plot([MarginCurve(replace(trace(), force=np.zeros((500, 3))), True, "")], 1)
    assert plot.count("<polyline") == 1 and "pushed" not in plot


@pytest.mark.parametrize(
    ("point", "side"),
    [((0.0, 0.0, 1.0), "middle"), ((0.0, -0.5, 1.0), "right"), ((0.0, 0.0, 1.5), "above")],
)
def test_points_are_projected_as_the_camera_sees_them(point: tuple[float, ...], side: str) -> None:
    shot = Shot(look_at=(0.0, 0.0, 1.0), azimuth=0.0, elevation=-10.0, distance=4.0)  # looks along x
    x, y = project(shot, (300, 400), np.array(point))
    if side == "middle":
        assert (x, y) == pytest.approx((150.0, 200.0))
    elif side == "right":
        assert x > 180.0 and y == pytest.approx(200.0, abs=1.0)
    else:
        assert y < 170.0 and x == pytest.approx(150.0)
