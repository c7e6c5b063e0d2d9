"""The rungs of standing and walking: who is lost, who does not walk, and what the shipped legs measure, cut short."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from golem.capabilities.legs.base import Envelope
from golem.errors import ConfigError
from golem.evaluation.base import RUNGS, TrialOutcome, TrialSpec, make_rung
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.rungs import leg_rung, stand_minute, walking
from golem.evaluation.rungs.leg_rung import NO_WALKER
from golem.evaluation.rungs.walking import command

METHODS = Path(__file__).parents[1] / "leg_methods.py"
ENVELOPE = Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6))


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_minute, "MINUTE", 8.0)
    monkeypatch.setattr(stand_minute.StandQuiet, "settle", 4.0)
    monkeypatch.setattr(stand_minute.StandArms, "settle", 3.0)
    monkeypatch.setattr(walking, "MINUTE", 8.0)
    monkeypatch.setattr(walking, "SECONDS", 6.0)


def run(rung: str, method: str, index: int = 0, profile: str = "ideal", **options: Any) -> TrialOutcome:
    made = make_rung(RUNGS[rung], options)
    case = made.cases(lambda case: None)[0]
    return made.run(TrialSpec(rung, method, profile, 0, index, case=case), None)


def shipped(rung: str, index: int = 0, profile: str = "bench") -> TrialOutcome:
    """Run a trial of the shipped legs as docs/results.md does; the bounds are twice that page's figures."""
    outcome = run(rung, "almi", index, profile, latency=0.02)
    assert outcome.success, outcome.detail
    return outcome


def test_the_first_commands_are_the_ends_edges_and_corners_of_the_envelope() -> None:
    rng = np.random.default_rng(0)
    twists = [command(ENVELOPE, rng, i) for i in range(26)]
    assert len({(t.vx, t.vy, t.wz) for t in twists}) == 26
    assert {t.vx for t in twists} == {-0.4, 0.0, 0.8}
    assert any((t.vx, t.vy, t.wz) == (0.8, -0.3, 0.6) for t in twists)
    drawn = command(ENVELOPE, rng, 26)
    assert ENVELOPE.clamp(drawn) == drawn and drawn not in twists


def test_few_trials_see_every_end_of_the_envelope() -> None:
    rng = np.random.default_rng(0)
    first = [command(ENVELOPE, rng, i) for i in range(6)]
    assert {(t.vx, t.vy, t.wz) for t in first} == {
        (-0.4, 0.0, 0.0), (0.8, 0.0, 0.0), (0.0, -0.3, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, -0.6), (0.0, 0.0, 0.6)
    }  # fmt: skip


def test_a_robot_that_stands_still_has_no_range_and_no_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stand_minute, "MINUTE", 1.0)
    outcome = run("stand-quiet", f"{METHODS}:Stiff")
    assert outcome.success
    assert outcome.series["steps"] == 0.0 and outcome.series["share_not_negative"] == 1.0
    assert outcome.series["base_range"] < 0.003


def test_a_broken_controller_is_lost_by_its_fault_and_flatters_no_mean() -> None:
    outcome = run("stand-quiet", f"{METHODS}:Broken")
    assert (outcome.success, outcome.stage) == (False, "fault")
    assert outcome.module == f"lower_body: {METHODS}:Broken" and "my bug" in outcome.detail
    assert outcome.series == {}


@pytest.mark.parametrize("rung", [name for name in RUNGS if name.startswith("walk-")])
def test_who_does_not_walk_is_told_so(rung: str) -> None:
    outcome = run(rung, f"{METHODS}:Stiff")
    assert (outcome.success, outcome.stage, outcome.series) == (False, NO_WALKER, {})


def test_the_plant_is_an_option() -> None:
    slow, other = (run("stand-quiet", f"{METHODS}:Stiff", latency=x) for x in (0.0, 0.03))
    assert slow.series != other.series
    with pytest.raises(ConfigError, match="feet"):
        run("stand-quiet", "wbc", robot=["feet=flippers"])


def test_the_rate_of_the_planner_is_timed_alone(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="times this machine: leave out -j"):
        run_ladder(LadderConfig(rung="mpc-rate", j=2, out=tmp_path / "run"))
    with pytest.raises(ConfigError, match="Unknown method 'almi'; valid: mpc"):
        run_ladder(LadderConfig(rung="mpc-rate", method=("almi",), out=tmp_path / "run"))


@pytest.mark.slow
def test_standing_is_measured_and_sweeping_arms_cost_margin() -> None:
    quiet, arms = shipped("stand-quiet").series, shipped("stand-arms").series
    assert 0.0 < quiet["sway"] < quiet["base_range"] < 2 * 0.0022 and quiet["steps"] == 0.0
    assert 0.095 / 2 < arms["margin_min"] < quiet["margin_min"] and arms["steps"] == 0.0
    assert 2.0 * quiet["base_range"] < arms["base_range"] < 2 * 0.023


@pytest.mark.slow
@pytest.mark.parametrize("index", [0, *(pytest.param(i, marks=pytest.mark.long) for i in (1, 2))])
def test_the_twist_is_tracked(index: int) -> None:
    series = shipped("walk-twist", index).series
    assert 0.0 < series["error_speed"] < 2 * 0.020 and series["error_wz"] < 2 * 0.030


@pytest.mark.slow
def test_a_robot_endures() -> None:
    series = shipped("walk-endurance").series
    assert series["seconds"] == pytest.approx(8.0, abs=0.1) and series["pushes"] >= 1.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ground", "climbed"),
    [
        ("slope-8", 0.1),
        ("rubble-5", -0.02),
        ("load-5", -0.02),
        pytest.param("slope", 0.05, marks=pytest.mark.long),
        pytest.param("rubble", -0.02, marks=pytest.mark.long),
    ],
)
def test_rough_ground_is_walked_over(ground: str, climbed: float) -> None:
    series = run("walk-rough", "almi", profile="bench", latency=0.02, ground=[ground]).series
    # In 10 s they come 3.84 to 3.92 m far of the 4 m that they are told.
    assert 2.4 - 2 * 0.16 < series["distance"] < 2.4 and climbed < series["climbed"] < 0.3


def test_every_ground_is_another_twin_and_an_unknown_one_is_refused() -> None:
    facts = make_rung(RUNGS["walk-rough"]).config("almi", "bench", {})
    assert list(facts) == list(walking.GROUNDS) and len({str(f) for f in facts.values()}) == len(facts)
    with pytest.raises(ConfigError, match="Unknown ground 'ice'.*slippery"):
        make_rung(RUNGS["walk-rough"], {"ground": ["ice"]})


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("count", [3, pytest.param(6, marks=pytest.mark.long)])
def test_poses_are_reached_as_precisely_and_as_surely_as_in_199_of_200_trials(count: int) -> None:
    made = make_rung(RUNGS["walk-stop"], {"latency": 0.02})
    trials = [made.run(TrialSpec("walk-stop", "almi", "field", 0, index), None) for index in range(count)]
    arrived = [trial for trial in trials if trial.success]
    errors = [trial.series["goal_radial"] for trial in trials]
    assert len(arrived) >= 3, [trial.detail for trial in trials]
    assert 0.0 < min(errors) and max(errors) < 2 * 0.054 and sum(errors) / len(errors) < 2 * 0.020
    assert all(4.0 < trial.timings["walk"] <= walking.TIMEOUT for trial in arrived)


@pytest.mark.slow
def test_plans_are_timed_and_the_record_does_not_depend_on_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from golem.evaluation.rungs import mpc_rate

    monkeypatch.setattr(mpc_rate, "PLANNED", 0.5)
    rung = make_rung(RUNGS["mpc-rate"])
    outcome = rung.run(TrialSpec("mpc-rate", "mpc", "bench", 0, 0, case={"samples": 8}), None)
    assert outcome.series == {} and outcome.costs["plans_per_second"] > 1.0
    assert 0.0 <= outcome.costs["in_time"] <= 1.0


@pytest.mark.parametrize(
    ("name", "case"),
    [
        ("push", {}),
        ("walk-rough", {"ground": "rubble"}),
        ("gate-limits", {"lift": "nothing"}),
        ("push-limit", {"terms": "stack"}),
        ("tour", {"engine": "mujoco"}),
    ],
)
def test_every_rung_of_legs_stands_at_the_height_that_is_asked_for(
    name: str, case: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(leg_rung, "Episode", lambda *_: SimpleNamespace(height=None))
    rung: Any = make_rung(RUNGS[name], {"height": 0.8})
    assert rung.episode(TrialSpec(name, "wbc", "bench", 0, 0, case=case)).height == 0.8
