"""A stack at its work is measured: function calls, CPU time by node, and the physics alone beside it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from golem.evaluation.speed import loop_measure
from golem.evaluation.speed.loop_measure import CASES, measure
from golem.runtime.executor import Executor

CALLS = {"stand": 80, "tether": 140}
"""Most Python and C functions that a tick of a robot that stands, or picks hanging, may call."""


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(loop_measure.CASES, "stand", replace(CASES["stand"], warm=0.2))


@pytest.mark.parametrize("stack", CALLS)
def test_a_robot_keeps_to_its_budget_of_calls(stack: str) -> None:
    calls = measure(stack, "calls", 0.5 if stack == "stand" else 1.5, 29)["calls"]
    assert 10 < calls <= CALLS[stack]


@pytest.mark.usefixtures("at_once")
def test_the_physics_alone_takes_less_than_the_stack() -> None:
    found = measure("stand", "totals", 0.3, 29)
    assert found["seconds"] == pytest.approx(0.3)
    assert 0.0 < found["physics"] < found["cpu"]
    assert not found["nodes"]


@pytest.mark.usefixtures("at_once")
def test_no_node_takes_longer_than_all() -> None:
    before = Executor.__init__
    found = measure("stand", "nodes", 0.3, 29)
    us = 1e6 * found["cpu"] * loop_measure.TICK / found["seconds"]
    assert found["nodes"] and 0.0 < sum(found["nodes"].values()) < us
    assert Executor.__init__ is before


def test_a_trial_that_ends_too_early_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(loop_measure.CASES, "stand", replace(CASES["stand"], warm=0.2))
    monkeypatch.setattr(loop_measure, "_trial", lambda *_: None)
    with pytest.raises(RuntimeError, match="stand"):
        measure("stand", "totals", 0.3, 29)
