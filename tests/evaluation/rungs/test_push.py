"""The push rung: draws that do not depend on the method, and trials that are judged on the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.episode import Loss
from golem.evaluation.rungs.push import MAX_FORCE, MIN_PEAK, PEAK, RATE, PushRampRung, PushRung, judge
from golem.robots.mujoco.balance import TRACE, BalanceTrace
from golem.robots.mujoco.shoves import DIRECTIONS, ROD_TIME, rod

METHODS = Path(__file__).parents[1] / "leg_methods.py"
STIFF = f"{METHODS}:Stiff"


def spec(method: str = STIFF, index: int = 0) -> TrialSpec:
    return TrialSpec("push", method, "ideal", 0, index)


def test_pushes_are_drawn_like_the_papers_and_not_by_the_method() -> None:
    draws = [PushRung().draw(spec(index=i).rng("push")) for i in range(2000)]
    peaks = np.array([push.peak for push, _ in draws])
    assert peaks.mean() == pytest.approx(PEAK[0], abs=0.6)
    assert peaks.std() == pytest.approx(PEAK[1], abs=0.5)
    assert peaks.min() >= MIN_PEAK
    assert {push.direction for push, _ in draws} == set(DIRECTIONS)
    assert PushRung().draw(spec("other", 5).rng("push")) == PushRung().draw(spec(index=5).rng("push"))


def test_a_trial_is_recorded_and_depends_on_its_spec_alone(tmp_path: Path) -> None:
    rung = PushRung()
    first = rung.run(spec(), tmp_path / "first")
    again = PushRung().run(spec(), None)
    assert first == again
    push, _ = rung.draw(spec().rng("push"))
    assert first.series["peak_force"] == pytest.approx(push.peak, rel=1e-3)
    assert first.series["margin_before"] > 0.08
    assert first.picture is not None and first.picture.startswith(b"\x89PNG"), "trial 0 is shown"
    trace = BalanceTrace.load(tmp_path / "first" / TRACE)
    pushed = trace.t[np.linalg.norm(trace.force, axis=1) > 0.0]
    assert np.ptp(pushed) == pytest.approx(ROD_TIME, abs=0.03)


def trace(margin: float) -> BalanceTrace:
    n = 400
    zeros = np.zeros((n, 3))
    t = 0.01 * np.arange(n, dtype=np.float64)
    margins = np.where((t > 2.2) & (t < 2.6), -0.04, margin)
    force = np.where((t > 2.0) & (t < 2.2), 22.0, 0.0)[:, None] * [0.0, 1.0, 0.0]
    return BalanceTrace(t, margins, zeros, zeros, np.zeros(n), zeros, np.ones((n, 2), bool), force)


def test_standing_again_is_a_success_with_the_time_it_took() -> None:
    outcome = judge(trace(0.1), 2.0, rod("left", 22.0), None, True, "mine")
    assert outcome.success
    assert outcome.timings["recovery"] == pytest.approx(0.4, abs=0.02)
    assert outcome.series["margin_min"] == pytest.approx(-0.04)
    assert outcome.series["below_zero"] == pytest.approx(0.4, abs=0.02)


@pytest.mark.parametrize(
    ("margin", "loss", "rests", "stage"),
    [
        (-0.02, None, False, "balance"),
        (0.1, None, False, "unrest"),
        (0.1, Loss("fall", "The robot fell."), False, "fall"),
    ],
    ids=["outside at the end", "still stepping", "fell"],
)
def test_what_was_lost_names_stage_and_lower_body(margin: float, loss: Loss | None, rests: bool, stage: str) -> None:
    outcome = judge(trace(margin), 2.0, rod("left", 22.0), loss, rests, "mine")
    assert not outcome.success and outcome.stage == stage and outcome.module == "lower_body: mine"
    assert "22 N to the left" in outcome.detail


def test_a_robot_that_fell_before_the_push_is_not_blamed_on_it() -> None:
    outcome = PushRung().run(spec(f"{METHODS}:Limp"), None)
    assert not outcome.success and outcome.module == f"lower_body: {METHODS}:Limp"
    assert outcome.stage == "settle" and outcome.series == {} and "not pushed yet" in outcome.detail


def test_a_controller_that_fails_in_its_band_is_lost_by_its_fault(tmp_path: Path) -> None:
    mine = tmp_path / "mine.py"
    mine.write_text(
        "from golem.capabilities.legs.hold import JointHold\n"
        "class Mine(JointHold):\n"
        "    def step(self, *inputs):\n"
        "        raise ValueError('my bug')\n"
    )
    outcome = PushRung().run(spec(f"{mine}:Mine"), None)
    assert (outcome.stage, outcome.module) == ("fault", f"lower_body: {mine}:Mine")
    assert outcome.detail.endswith("my bug (mine.py:4). It was not pushed yet.")


def test_the_ramp_grows_until_the_balance_is_lost_and_lets_go(tmp_path: Path) -> None:
    outcome = PushRampRung().run(replace(spec(), rung="push-ramp"), tmp_path)
    assert outcome.stage == "safety" and "balance_lost" in outcome.detail  # it is stiff
    assert outcome.module == f"lower_body: {STIFF}"
    trace = BalanceTrace.load(tmp_path / TRACE)
    force = np.linalg.norm(trace.force, axis=1)
    pushed = np.flatnonzero(force)
    assert np.diff(force[pushed]) / np.diff(trace.t[pushed]) == pytest.approx(RATE, rel=0.05)
    assert (trace.margin[pushed[:-1]] >= 0.0).all() and trace.margin[pushed[-1] + 1] < 0.0
    assert outcome.series["peak_force"] == pytest.approx(force.max())
    assert 20.0 < force.max() < MAX_FORCE
    assert len(trace.t) > pushed[-1] + 10 and not force[pushed[-1] + 1 :].any()
    assert trace.margin[-1] < -0.05 and trace.tilt[-1] > 0.3


def test_a_ramp_ends_at_its_peak() -> None:
    push, _ = PushRampRung().draw(spec().rng("push"))
    assert np.linalg.norm(push.force(0.5 * push.duration, 0.3)) == pytest.approx(0.5 * MAX_FORCE)
    assert not push.force(push.duration, 0.3).any()
    assert push.impulse == pytest.approx(0.5 * MAX_FORCE * push.duration)
