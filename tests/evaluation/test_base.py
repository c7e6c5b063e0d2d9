from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import TrialOutcome, TrialSpec, make_rung, rung_target

SPEC = TrialSpec("tether", "centroid", "field", 0, 3)


def draw(spec: TrialSpec, stream: str) -> list[float]:
    return spec.rng(stream).random(4).tolist()


def test_methods_share_the_draws_of_a_trial() -> None:
    assert draw(SPEC, "scene") == draw(replace(SPEC, method="visual_servo", profile="ideal"), "scene")


@pytest.mark.parametrize("other", [{"index": 4}, {"seed": 1}, {"seed": 3, "index": 0}])
def test_trials_and_streams_draw_differently(other: dict[str, int]) -> None:
    assert not np.isclose(draw(SPEC, "scene"), draw(replace(SPEC, **other), "scene")).any()
    assert not np.isclose(draw(SPEC, "scene"), draw(SPEC, "camera")).any()


@pytest.mark.parametrize(
    "contradiction",
    [
        {"success": True, "stage": "reach"},
        {"success": False, "stage": "done"},
        {"success": True, "stage": "done", "module": "upper_body: diff_ik"},
        {"success": True, "stage": "done", "timings": {"total": float("nan")}},
        {"success": True, "stage": "done", "series": {"error": float("inf")}},
    ],
)
def test_an_outcome_that_contradicts_itself_is_refused(contradiction: dict[str, Any]) -> None:
    with pytest.raises(ValueError):
        TrialOutcome(**contradiction)


def test_an_unknown_rung_is_answered_with_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match=r"Unknown rung 'teter'; valid: .*tether.*Did you mean 'tether'\?"):
        rung_target("teter")


def test_a_class_that_is_no_rung_is_refused() -> None:
    with pytest.raises(TypeError, match="does not satisfy"):
        make_rung("collections:OrderedDict")
