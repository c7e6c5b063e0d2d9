"""Robot hours and stops, from run folders."""

from __future__ import annotations

import json
import math
from collections.abc import Callable

import pytest

from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.harness.run_folder import read_costs
from golem.evaluation.metrics.results import GateHours, ResultsConfig, run_results


def test_hours_and_stops_add_up() -> None:
    one, other = {"active": 1800.0, "stops": {"tilt": 1}}, {"active": 5400.0, "stops": {"tilt": 1, "joint_torque": 1}}
    both = GateHours.of([one, {"wall": 3.0}, other])
    assert (both.trials, both.active) == (2, 7200.0)
    assert both.sentence().startswith(
        "Safety gate: 2 robot hours open in 2 trials, 3 stops (`tilt` 2, `joint_torque` 1);"
    )


def test_no_stop_in_three_hours_is_fewer_than_one_an_hour() -> None:
    assert GateHours(1, 3.0 * 3600.0).most_per_hour == pytest.approx(0.9986, abs=1e-4)
    assert math.isinf(GateHours().most_per_hour)


def test_a_run_says_its_hours_and_several_say_their_sum(fake: Callable[..., LadderConfig]) -> None:
    first, second = run_ladder(fake("good", n=2)), run_ladder(fake("good", n=3, out="more"))
    for run in (first, second):
        costs = read_costs(run.out)
        assert all(line["active"] == 0.0 and line["stops"] == {} for line in costs), "no stack ran"
        lines = [line | {"active": 3600.0, "stops": {"tilt": 1}} for line in costs]
        (run.out / "timings.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
    text = run_results(ResultsConfig((first.out, second.out)))
    assert "2 robot hours open in 2 trials, 2 stops (`tilt` 2)" in text
    assert "In all. Safety gate: 5 robot hours open in 5 trials, 5 stops (`tilt` 5)" in text
