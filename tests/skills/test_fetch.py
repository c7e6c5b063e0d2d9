"""Errands that go as a test says: recall, take, place, and what is done where the thing is not there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.skills.conftest import modules

from golem.capabilities.memory.object_map import ObjectMap
from golem.capabilities.navigation.edge_fit import NearEdge
from golem.errors import ConfigError
from golem.evaluation.conformance.memory_suite import look
from golem.interfaces import topics
from golem.interfaces.memory_payloads import MemoryStatus
from golem.interfaces.nav_payloads import MapPlace, OccupancyGrid
from golem.interfaces.payloads import GripState, HandStatus, LegStatus, Odometry
from golem.middleware.bus import Bus
from golem.robots.model.pinocchio_model import Kinematics
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.fetch import BESIDE, Fetch, FetchGoal, stance
from golem.skills.place import SetDown
from golem.skills.remember import Remember
from golem.skills.runner import SkillRun
from golem.skills.take import Take
from golem.skills.take_config import TakeReport
from golem.types import SIDES, Array, BaseEstimate, PlanarPose, Twist

LEGS = LegStatus(
    0.0, Twist(), Twist(), False, "", False, False, PlanarPose(0.0, 0.0, 0.0), np.zeros(2), "hold", speed=0.0
)
NOT_THERE = SkillResult(False, "detect", "localizer", "The head camera shows no mug.", value=TakeReport())
TAKEN = SkillResult(
    True, "done", None, "", value=TakeReport("left", "top", below=0.08, above=0.02, off_x=0.01, off_y=-0.07)
)
HERE = PlanarPose(0.0, 0.0, 0.0)
ALWAYS = 2.0
"""Stamp of a pose of the odometry that is never old in these tests [s]."""
DONE = SkillResult(True, "done", None, "")


class Scripted:
    """A skill that ends at once, each time with the next of its results."""

    def __init__(self, kind: type[Any], results: Sequence[SkillResult]) -> None:
        self.Goal, self.results, self.goals = kind.Goal, results, list[Any]()

    def timeout(self, goal: object) -> float:
        """Allow a second."""
        return 1.0

    async def run(self, context: Context, goal: object) -> SkillResult:
        """End."""
        self.goals.append(goal)
        return self.results[len(self.goals) - 1]


def fetch(
    goal: FetchGoal, takes: Sequence[SkillResult], places: Sequence[SkillResult] = (DONE,), seen: bool = True,
    state: GripState = GripState.HOLDING, closes: GripState = GripState.EMPTY, T_odom_estimate: PlanarPose = HERE,
    T_odom_map: PlanarPose | None = None, frame: str = "odom", speed: float = 0.0,
) -> tuple[SkillResult, dict[str, Scripted]]:  # fmt: skip
    """Return how an errand of a robot that walks at `speed` [m/s] ended, and what was asked of which skill."""
    skills = {"take": Scripted(Take, takes), "place": Scripted(SetDown, places), "remember": Scripted(Remember, [DONE])}
    memory = ObjectMap()
    if seen:
        memory.observe(look(98.0))
    context = Context(Bus(), Kinematics(), 0.01, modules(skill=skills.__getitem__, memory=memory))
    context.bus.publish(topics.MEMORY_STATUS, MemoryStatus(0.0, frame, 100.0, 1), 0.0)
    context.bus.publish(topics.LEG_STATUS, replace(LEGS, speed=speed), 0.0)
    context.bus.publish(topics.hand_status("left"), HandStatus(0.0, state, 0.07, 0.0, np.zeros(2)), 0.0)
    context.bus.publish(topics.BASE, BaseEstimate(0.0, np.eye(4)), 0.0)
    context.bus.publish(topics.ODOMETRY, Odometry(ALWAYS, T_odom_estimate.matrix()), 0.0)
    if T_odom_map is not None:
        grid = OccupancyGrid(0.0, T_odom_map, 0.1, np.zeros((50, 50), np.int8), T_odom_map)
        context.bus.publish(topics.MAP, grid, 0.0)
        context.bus.publish(topics.MAP_POSE, MapPlace(0.0, T_odom_map, T_odom_map.to(T_odom_estimate)), 0.0)
    run = SkillRun("fetch", Fetch().run(context, goal))
    for _ in range(200):
        context.refresh(context.t + 0.01)
        run.step()
        if context.bus.latest(topics.hand_goal("left")) is not None:
            said = HandStatus(context.t, closes, 0.03, 0.0, np.zeros(2))
            context.bus.publish(topics.hand_status("left"), said, context.t)
    assert run.error is None and run.result is not None
    return run.result, skills


def test_it_takes_it_where_it_is_remembered_and_sets_it_down_as_it_was_taken() -> None:
    result, skills = fetch(FetchGoal("mug", (0.5, 0.1)), [TAKEN])
    assert result.success, result
    (taken,), (placed,) = skills["take"].goals, skills["place"].goals
    assert taken.near == pytest.approx((0.4, 0.0), abs=0.002) and taken.label == "mug"
    assert (placed.x, placed.y, placed.side, placed.below, placed.above) == (0.5, 0.1, "left", 0.08, 0.02)
    assert placed.label == "mug"  # whose picture is to be a new one
    assert placed.off == (0.01, -0.07)  # of a head camera that is off by that much
    assert result.value.looked == pytest.approx([0.4, 0.0], abs=0.002)


def test_hands_get_places_in_the_odom_that_they_go_by() -> None:
    drifted, T_odom_map = PlanarPose(0.2, -0.1, 0.3), PlanarPose(-0.3, 0.4, 0.5)
    result, skills = fetch(
        FetchGoal("mug", (0.5, 0.1)), [TAKEN], T_odom_estimate=drifted, T_odom_map=T_odom_map, frame="map"
    )
    (taken,), (placed,) = skills["take"].goals, skills["place"].goals
    there, to = (T_odom_map @ PlanarPose(x, y, 0.0) for x, y in ((0.4, 0.0), (0.5, 0.1)))
    assert result.success and result.value.looked == pytest.approx([there.x, there.y], abs=0.002)
    there, to = drifted.to(there), drifted.to(to)
    assert taken.near == pytest.approx((there.x, there.y), abs=0.002)
    assert (placed.x, placed.y) == pytest.approx((to.x, to.y))


def test_what_is_remembered_in_a_map_is_gone_to_nowhere_before_the_map_has_a_place() -> None:
    result, skills = fetch(FetchGoal("mug", (0.5, 0.1)), [TAKEN], frame="map")
    assert (result.success, result.slot) == (False, "mapper") and "not known" in result.reason
    assert not skills["take"].goals


def test_without_a_map_what_is_remembered_is_in_the_odom_of_the_hands() -> None:
    goal = FetchGoal("mug", (0.5, 0.1), "base_link")
    result, skills = fetch(goal, [TAKEN], T_odom_estimate=PlanarPose(0.2, -0.1, 0.3))
    (taken,), (placed,) = skills["take"].goals, skills["place"].goals
    assert result.success and taken.near == pytest.approx((0.4, 0.0), abs=0.002)
    assert (placed.x, placed.y) == pytest.approx((0.5, 0.1))


@pytest.mark.parametrize("y", [-0.3, 0.0, 0.3])
def test_it_stands_where_the_hand_that_holds_it_gets_to_its_place(y: float) -> None:
    edge = NearEdge(PlanarPose(0.8, 0.0, 0.0), 2.0, 0.0, 40)
    for side, sign in zip(SIDES, (1.0, -1.0), strict=True):
        pose = stance(edge, PlanarPose(0.0, 0.0, 0.0), np.array([0.9, y]), side)
        assert sign * pose.to(PlanarPose(0.9, y, 0.0)).y == pytest.approx(BESIDE)


def test_a_place_that_was_seen_is_as_far_off_as_what_was_taken() -> None:
    result, skills = fetch(FetchGoal("mug", (0.5, 0.1), "seen"), [TAKEN])
    (placed,) = skills["place"].goals
    off = 0.75 * complex(0.01, -0.07) * complex(0.5, 0.1)
    assert result.success and (placed.x, placed.y) == pytest.approx((0.5 + off.real, 0.1 + off.imag))


def test_without_a_place_it_stays_in_the_hand() -> None:
    result, skills = fetch(FetchGoal("mug"), [TAKEN])
    assert result.success and "left hand" in result.reason and not skills["place"].goals


def test_what_is_not_there_is_said_with_the_slot() -> None:
    result, skills = fetch(FetchGoal("mug"), [NOT_THERE])
    assert (result.success, result.stage, result.slot) == (False, "detect", "localizer")
    assert len(skills["take"].goals) == 1


def test_what_was_never_seen_is_looked_for_and_taken() -> None:
    result, skills = fetch(FetchGoal("mug"), [TAKEN], seen=False)
    assert result.success and len(skills["remember"].goals) == 1
    assert skills["take"].goals[0].near == ()


def test_what_is_lost_on_the_way_is_noticed() -> None:
    result, skills = fetch(FetchGoal("mug", (0.5, 0.1)), [TAKEN], state=GripState.SLIPPED)
    assert (result.stage, result.slot) == ("carry", "grasp_method") and not skills["place"].goals


def test_what_slid_in_the_fingers_is_gripped_again_and_set_down() -> None:
    goal = FetchGoal("mug", (0.5, 0.1))
    result, skills = fetch(goal, [TAKEN], state=GripState.SLIPPED, closes=GripState.HOLDING)
    assert result.success and len(skills["place"].goals) == 1


def test_a_failed_place_is_the_errands_failure() -> None:
    blocked = SkillResult(False, "detect", "localizer", "Something else stands at that place.")
    result, _ = fetch(FetchGoal("mug", (0.5, 0.1)), [TAKEN], [blocked])
    assert not result.success and result.reason == blocked.reason


@pytest.mark.parametrize("value", [None, TakeReport(), TakeReport(x=0.5, y=0.1, z=-0.1)])
def test_only_what_was_seen_is_gone_to_again(monkeypatch: pytest.MonkeyPatch, value: TakeReport | None) -> None:
    gone: list[list[float]] = []

    async def go(fetch: Fetch, context: Context, spot: Array, *_: object) -> int:
        gone.append(spot.tolist())
        return 1

    monkeypatch.setattr(Fetch, "_go", go)
    late = SkillResult(False, "timeout", None, "Not done after 90 s of robot time.", value=value)
    result, skills = fetch(FetchGoal("mug", search=False), [late, late], speed=0.3)
    assert not result.success
    places = [[0.4, 0.0]] if value != TakeReport(x=0.5, y=0.1, z=-0.1) else [[0.4, 0.0], [0.5, 0.1]]
    assert gone == [pytest.approx(place, abs=0.002) for place in places]
    assert len(skills["take"].goals) == len(places)


@pytest.mark.parametrize("wrong", [{"text": " "}, {"text": "mug", "to": (1.0,)}, {"text": "mug", "places": 0}])
def test_a_goal_without_sense_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        FetchGoal(**wrong)
