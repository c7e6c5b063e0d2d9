"""The gate and the base estimate: a robot whose feet stop measuring is stopped, one that hangs or hops is not."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.hardware.safety.base import OperatorRequest
from golem.interfaces.payloads import GateState, Reason
from golem.types import BaseEstimate


def base(t: float, stale: bool = False) -> BaseEstimate:
    return BaseEstimate(t, np.eye(4), stale=stale)


def run(bench: Any, seconds: float, stale: bool) -> None:
    for _ in range(round(seconds / 0.002)):
        bench.tick(base=base(bench.t + 0.002, stale))


@pytest.fixture
def standing(bench: Any) -> Any:
    bench.activate()
    run(bench, 0.1, stale=False)
    return bench


@pytest.mark.parametrize("how", ["stale", "missing", "repeated", "from the future", "without a time"])
def test_without_a_fresh_estimate_the_robot_is_stopped_within_the_age(how: str, standing: Any) -> None:
    last = standing.t
    frames = {
        "stale": lambda t: base(t, stale=True),
        "missing": lambda t: None,
        "repeated": lambda t: base(last),
        "from the future": lambda t: base(t + 1.0),
        "without a time": lambda t: base(float("nan")),
    }
    for _ in range(1000):
        result = standing.tick(base=frames[how](standing.t + 0.002))
        if result.state is not GateState.ACTIVE:
            break
    assert (result.state, result.reason) == (GateState.STOP1, Reason.BASE_STALE)
    assert standing.t - last == pytest.approx(standing.gate.limits.base_age, abs=0.0041)
    assert result.detail.startswith("for 30")


def test_a_stale_spell_shorter_than_the_age_does_not_stop(standing: Any) -> None:
    for _ in range(5):
        run(standing, 0.9 * standing.gate.limits.base_age, stale=True)
        run(standing, 0.01, stale=False)
    assert standing.results[-1].state is GateState.ACTIVE


def test_a_robot_in_a_band_is_not_stopped_before_its_feet_have_carried_it(bench: Any) -> None:
    bench.activate()
    run(bench, 2.0, stale=True)
    assert bench.results[-1].state is GateState.ACTIVE
    run(bench, 0.1, stale=False)
    run(bench, 0.5, stale=True)
    assert bench.results[-1].reason is Reason.BASE_STALE


def test_after_a_reset_it_may_hang_again(standing: Any) -> None:
    run(standing, 0.5, stale=True)
    assert standing.results[-1].state is GateState.STOP1
    run(standing, 1.0, stale=True)
    standing.tick(request=OperatorRequest.RESET, base=base(standing.t + 0.002, stale=True))
    standing.tick(request=OperatorRequest.ACTIVATE, base=base(standing.t + 0.002, stale=True))
    run(standing, 1.0, stale=True)
    assert standing.results[-1].state is GateState.ACTIVE
