from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.base import RUNGS, TrialOutcome, TrialSpec, case_name, make_rung, rung_class

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
        rung_class("teter")


def test_every_rung_has_what_the_command_needs() -> None:
    for name in RUNGS:
        rung = make_rung(RUNGS[name])
        assert rung.name == name
        assert set(rung.default_methods) <= set(rung.methods()) and rung.default_methods
        assert rung.default_profile in rung.profiles
        names = {tuple(case) for case in rung.cases(lambda case: None)}
        assert len(names) == 1, "all cases have the same names"


def test_a_wrong_option_of_a_rung_is_answered_with_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match="option of rung push-limit 'phrase'.*Did you mean 'phase'"):
        make_rung(RUNGS["push-limit"], {"phrase": ["standing"]})
    with pytest.raises(ConfigError, match="standin.*Did you mean 'standing'"):
        make_rung(RUNGS["push-limit"], {"phase": ["standin"]})


def test_a_case_is_called_by_its_values() -> None:
    assert case_name({"direction": "front_left", "level": 40.0}) == "front_left 40"
    assert case_name({}) == ""


def test_a_class_that_is_no_rung_is_refused() -> None:
    with pytest.raises(TypeError, match="is no golem.evaluation.base.Rung"):
        make_rung("collections:OrderedDict")
