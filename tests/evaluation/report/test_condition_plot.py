"""Success by condition of varied work places."""

from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.base import TrialSpec
from golem.evaluation.report.svg_figure import PARTS, Placed, condition_plot, page_figure, parts, styled
from golem.evaluation.rungs.pick_screw import PickOptions, conditions_of
from golem.robots.worlds.conditions import CHOICES, RANGES


def spec(index: int) -> TrialSpec:
    return TrialSpec("tether", "m", "field", 3, index)


@pytest.fixture
def trials() -> list[Placed]:
    """Forty trials, of which those in the dark and those with brass screws are lost."""
    places = [conditions_of(PickOptions("varied"), spec(i)) for i in range(40)]
    return [(place, place.light > 0.4 and place.finish != "brass") for place in places]


def test_every_trial_counts_once_in_every_condition(trials: list[Placed]) -> None:
    found = parts(trials)
    for name in (*RANGES, *CHOICES):
        mine = [part for part in found if part.condition == name]
        assert sum(part.n for part in mine) == 40
        assert sum(part.won for part in mine) == sum(won for _, won in trials)
    assert [part.n for part in found if part.condition == "light"] == [10] * PARTS


def test_what_loses_shows(trials: list[Placed]) -> None:
    found = {(part.condition, part.name): part for part in parts(trials)}
    assert found["finish", "brass"].won == 0
    light = [part for part in parts(trials) if part.condition == "light"]
    assert light[0].won == 0 < light[-1].won


def test_a_trial_without_difference_is_one_part() -> None:
    (part,) = [p for p in parts([(conditions_of(PickOptions(), spec(0)), True)] * 5) if p.condition == "light"]
    assert (part.name, part.won, part.n) == ("1 to 1", 5, 5)


def test_a_panel_per_condition_is_drawn(trials: list[Placed]) -> None:
    with styled():
        figure = page_figure(420.0)
        condition_plot({"a": trials, "b": trials[:20]}, figure)
        titles = [panel.get_title(loc="left") for panel in figure.axes if panel.axison]
    assert titles == [name.replace("_", " ") for name in (*RANGES, *CHOICES)]
    heights = [line.get_ydata()[0] for panel in figure.axes for line in panel.lines if len(line.get_ydata()) == 1]
    assert np.min(heights) == 0.0
