"""Whether a pick could be done: quick inverse kinematics say yes, the controller has the last word on no."""

from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.episodes.pick_claims import Fastener
from golem.evaluation.rungs import pick_screw as module
from golem.evaluation.rungs.pick_screw import doable, glimpsed, reaches
from golem.types import Array

NEAR, FAR = np.array([0.45, 0.2, 0.1]), np.array([1.5, 0.2, 0.1])


def screw(place: Array) -> Fastener:
    return Fastener(place, place, loose=True)


def test_both_ways_agree_near_and_far() -> None:
    assert glimpsed("left", NEAR) and reaches("left", NEAR)
    assert not glimpsed("left", FAR) and not glimpsed("right", FAR)


def test_a_scene_is_asked_about_once(monkeypatch: pytest.MonkeyPatch) -> None:
    assert doable([screw(NEAR)], NEAR[None] + 0.01)
    monkeypatch.setattr(module, "glimpsed", lambda side, place: pytest.fail("asked again"))
    assert doable([screw(NEAR)], NEAR[None] + 0.01)


def test_what_is_not_glimpsed_is_searched_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "glimpsed", lambda side, place: False)
    monkeypatch.setattr(module, "reaches", lambda side, place: side == "right")
    assert doable([screw(NEAR)], NEAR[None] + 0.02)


def test_nothing_loose_is_not_doable() -> None:
    assert not doable([], NEAR[None])
