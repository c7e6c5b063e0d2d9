"""What a planner is asked for beyond a way: the speed of the hands and the accelerations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from golem.capabilities.planning.base import Plan, PlanRequest
from golem.capabilities.planning.rrt_connect import Straight
from golem.evaluation.conformance.base import FAILED, Candidate
from golem.evaluation.conformance.examine import examine


class Hasty:
    """Goes as `straight` does, each plan changed."""

    latency = 0.05

    def __init__(self, given: Callable[[PlanRequest], PlanRequest], hurry: float = 1.0) -> None:
        self._given, self._hurry, self._planner = given, hurry, Straight()

    def plan(self, request: PlanRequest) -> Plan:
        plan = self._planner.plan(self._given(request))
        return replace(plan, times=plan.times / self._hurry, dq=plan.dq * self._hurry)


@pytest.mark.parametrize(
    ("check", "words", "module"),
    [
        (
            "keeps_the_hands_speed",
            "m/s where hand_speed asks for 0.1 m/s",
            lambda: Hasty(lambda request: replace(request, hand_speed=0.5)),
        ),
        ("accelerates_gently", "rad/s^2, more than 8", lambda: Hasty(lambda request: request, 2.2)),
    ],
)
def test_a_planner_in_a_hurry_is_named(check: str, words: str, module: Callable[[], Hasty]) -> None:
    report = examine(Candidate("planner", "hasty", module))
    found = {f.check: f.reason for f in report.findings if f.status == FAILED}
    assert words in found.get(check, ""), found
    assert found.keys() <= {check, "keeps_the_hands_speed"}
