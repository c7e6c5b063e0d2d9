"""The navigation rung: who cannot walk is told so at once; who can is judged on the true pose."""

from __future__ import annotations

from pathlib import Path

import pytest

from golem.evaluation.base import TrialSpec
from golem.evaluation.rungs import navigate_hall
from golem.evaluation.rungs.navigate_hall import NavigateLine

STIFF = f"{Path(__file__).parents[1] / 'leg_methods.py'}:Stiff"


def spec(method: str) -> TrialSpec:
    return TrialSpec("navigate-line", method, "ideal", 0, 0)


def test_a_lower_body_that_cannot_walk_is_not_sent(tmp_path: Path) -> None:
    outcome = NavigateLine().run(spec(STIFF), tmp_path / "trial")
    assert (outcome.success, outcome.stage) == (False, "walk")
    assert outcome.module == f"lower_body: {STIFF}" and "does not walk" in outcome.detail
    assert not (tmp_path / "trial").exists()


@pytest.mark.slow
def test_ours_walks_a_line_and_is_judged_where_it_truly_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(navigate_hall, "DISTANCE", 1.5)
    outcome = NavigateLine().run(spec("almi"), tmp_path / "trial")
    assert outcome.success, outcome.detail
    assert outcome.series["goal_radial"] < 0.2
    assert outcome.series["steps"] >= 4
    assert 2.0 < outcome.timings["walk"] < 30.0
