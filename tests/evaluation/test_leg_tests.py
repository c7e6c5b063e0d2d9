"""The leg tests on the shipped legs, cut short: what they measure is in the range of what is known of them."""

from __future__ import annotations

import pytest

from golem.evaluation import leg_tests
from golem.evaluation.subject import Subject

pytestmark = pytest.mark.slow
SUBJECT = Subject("almi", "bench", {"latency": 0.02})


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, seconds in (("MINUTE", 8.0), ("CALM", 4.0), ("ROUGH_TIME", 6.0)):
        monkeypatch.setattr(leg_tests, name, seconds)


def measured(test: str, index: int = 0) -> leg_tests.Figures:
    figures = leg_tests.TESTS[test](SUBJECT, 0, index)
    assert figures["lost"] == 0.0
    return figures


def test_standing_quietly_is_measured() -> None:
    figures = measured("quiet")
    assert 0.0 < figures["sway"] < figures["base_range"] < 0.02 and figures["steps"] == 0.0


def test_sweeping_arms_cost_margin() -> None:
    quiet, arms = measured("quiet"), measured("arms")
    assert 0.02 < arms["margin_min"] < quiet["margin_min"] and arms["never_negative"] == 1.0
    assert arms["base_range"] > 2.0 * quiet["base_range"]


def test_the_twist_is_tracked() -> None:
    figures = measured("tracking", index=1)
    asked = [figures[axis] for axis in ("vx", "vy", "wz")]
    assert any(asked)
    assert 0.0 < figures["error_speed"] < 0.1 and figures["error_wz"] < 0.1


def test_a_robot_endures() -> None:
    figures = measured("endurance")
    assert figures["seconds"] == pytest.approx(8.0, abs=0.1) and figures["pushes"] >= 1.0


@pytest.mark.parametrize(("test", "climbed"), [("slope", 0.03), ("rubble", -0.02)])
def test_rough_ground_is_walked_over(test: str, climbed: float) -> None:
    figures = measured(test)
    assert 1.5 < figures["distance"] < 2.6 and climbed < figures["climbed"] < 0.2


def test_a_pose_is_reached_and_judged() -> None:
    # Not trial 0, a rare one that takes several stops: chance decides whether the last comes within 40 s.
    figures = measured("stopping", index=1)
    assert figures["arrived"] == 1.0 and 0.0 < figures["error"] < 0.12 and figures["seconds"] > 4.0
