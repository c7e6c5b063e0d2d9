"""The planner: around what is in the way, within every limit, and a clear word where there is no way."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.arms.trajectory import interpolate
from golem.capabilities.collision.obstacles import Obstacle, World, cloud_grid
from golem.capabilities.planning.base import Held, Plan, PlanRefused, PlanRequest, Refusal
from golem.capabilities.planning.path_planner import fine_points
from golem.capabilities.planning.rrt_connect import RrtConnect, Straight
from golem.capabilities.planning.rules import Balanced, HandBox, HandUpright
from golem.errors import ConfigError
from golem.types import Array

HOME, READY = posture("home"), posture("ready_right")
SCREW = np.array([[0.0, 0.0, 0.01, 0.01], [0.0, 0.0, 0.05, 0.01]])


def box(x: float, y: float, z: float, *half: float) -> Obstacle:
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return Obstacle("box", T, half)


PACK = World([box(1.02, 0.0, -0.15, 0.6, 1.0, 0.075)])
BARRED = World([*PACK.obstacles, box(0.42, -0.34, 0.1, 0.06, 0.01, 0.18)])
"""A plate between home and ready, on the straight way of the right hand."""


@pytest.fixture(scope="module")
def planner() -> RrtConnect:
    return RrtConnect()


@pytest.fixture(scope="module")
def around(planner: RrtConnect) -> Plan:
    return planner.plan(PlanRequest(HOME, READY, BARRED))


def refused(planner: Any, refusal: Refusal, words: str | None, **given: Any) -> None:
    with pytest.raises(PlanRefused, match=words) as caught:
        planner.plan(replace(PlanRequest(HOME, READY, PACK), **given))
    assert caught.value.refusal is refusal


def test_the_straight_line_is_taken_where_it_is_free(planner: RrtConnect) -> None:
    plan = planner.plan(PlanRequest(HOME, READY, PACK))
    np.testing.assert_array_equal(plan.corners, [HOME, READY])
    np.testing.assert_allclose(plan.q[[0, -1]], [HOME, READY], atol=1e-12)


def test_around_what_is_in_the_way(planner: RrtConnect, around: Plan) -> None:
    refused(Straight(), Refusal.NO_PATH, "in the way of a straight line", world=BARRED)
    assert len(around.corners) > 2
    Q = fine_points(around.times, around.q, around.dq)
    assert np.abs(np.diff(Q, axis=0)).max() <= 0.0101
    assert not planner.robot.model().collides_each(Q, 0.0, BARRED).any()


def test_what_need_not_move_does_not(around: Plan) -> None:
    left = slice(1, 8)
    assert np.ptp(around.q[:, left], axis=0).max() < 1e-12


def test_the_same_request_gets_the_same_answer(planner: RrtConnect, around: Plan) -> None:
    again = planner.plan(PlanRequest(HOME, READY, BARRED))
    np.testing.assert_array_equal(again.times, around.times)
    np.testing.assert_array_equal(again.q, around.q)


@pytest.mark.parametrize("speed", [1.0, 0.3])
def test_speeds_and_accelerations_stay_within_their_limits(planner: RrtConnect, speed: float) -> None:
    plan = planner.plan(PlanRequest(HOME, READY, BARRED, speed=speed, hand_speed=0.4))
    dt = 0.001
    Q = interpolate(plan.times, plan.q, plan.dq, np.arange(0.0, plan.times[-1], dt))
    v = np.diff(Q, axis=0) / dt
    assert (np.abs(v) <= speed * planner.speed * 1.02).all()
    assert np.abs(plan.dq[[0, -1]]).max() == 0.0
    # A mean over 20 ms: between two points of a cubic the acceleration jumps.
    a = np.diff(v[::20], axis=0) / (20 * dt)
    assert (np.abs(a) <= 1.5 * planner.accel).all()
    kinematics = UpperKinematics()
    hands = np.array([kinematics.pose("right", q)[:3, 3] for q in Q[::10]])
    assert np.linalg.norm(np.diff(hands, axis=0), axis=1).max() / (10 * dt) < 0.4 * 1.05


def test_rules_hold_all_the_way(planner: RrtConnect) -> None:
    kinematics = UpperKinematics()
    T = downward(0.45, -0.05, 0.1, -0.5 * np.pi)
    goal = GoalPostures().find(None, T, READY, lambda q: True)
    rules = (HandUpright("right", np.deg2rad(20.0)), HandBox("right"), Balanced(0.03))
    plan = planner.plan(PlanRequest(READY, goal, PACK, rules))
    poses = [kinematics.pose("right", q) for q in fine_points(plan.times, plan.q, plan.dq)]
    tilt = np.arccos([-pose[2, 2] for pose in poses])
    assert tilt.max() < np.deg2rad(20.0)
    at = np.array([pose[:3, 3] for pose in poses])
    assert (at > (0.0, -0.45, -0.05)).all() and (at < (0.60, 0.45, 0.60)).all()


@pytest.mark.parametrize(
    ("rule", "words"),
    [
        (HandBox("right", (0.0, -0.1, 0.0), (0.6, 0.1, 0.6)), "right hand stays within its box"),
        (HandUpright("right", 0.1, (1.0, 0.0, 0.0)), "within 6 deg of its axis"),
    ],
)
def test_a_start_against_a_rule_is_refused(planner: RrtConnect, rule: Any, words: str) -> None:
    refused(planner, Refusal.START, words, rules=(rule,))


def test_the_centre_of_mass_is_where_pinocchio_has_it(planner: RrtConnect) -> None:
    refused(planner, Refusal.GOAL, "the centre of mass moves by 1 mm at most", rules=(Balanced(0.001),))
    assert planner.plan(PlanRequest(HOME, READY, PACK, (Balanced(0.02),))).times[-1] > 0.0


@pytest.mark.parametrize("make", [lambda: HandBox("left", (0.1, 0, 0), (0.1, 1, 1)), lambda: Balanced(0.0),
                                  lambda: HandUpright("left", 0.0)])  # fmt: skip
def test_a_rule_without_sense_is_refused(make: Any) -> None:
    with pytest.raises(ConfigError):
        make()


def test_what_a_hand_holds_counts(planner: RrtConnect) -> None:
    kinematics = UpperKinematics()
    tip = kinematics.pose("right", READY)[:3, 3]
    below = World([box(tip[0], tip[1], tip[2] - 0.05, 0.1, 0.1, 0.025)])
    assert planner.plan(PlanRequest(HOME, READY, below)).times[-1] > 0.0
    refused(planner, Refusal.GOAL, "something is in the way", world=below, held=(Held("right", SCREW),))


def test_a_goal_inside_the_pack_is_refused(planner: RrtConnect) -> None:
    inside = World([box(0.43, -0.22, 0.15, 0.1, 0.1, 0.1)])
    refused(planner, Refusal.GOAL, "goal may not be gone to: something is in the way", world=inside)


def test_the_goal_that_is_free_is_taken(planner: RrtConnect) -> None:
    bent = READY.copy()
    bent[11] = 9.0
    plan = planner.plan(PlanRequest(HOME, np.array([bent, READY]), PACK))
    np.testing.assert_allclose(plan.q[-1], READY, atol=1e-12)


def test_a_start_in_collision_is_refused(planner: RrtConnect) -> None:
    inside = World([box(0.36, -0.44, 0.25, 0.1, 0.1, 0.1)])
    refused(planner, Refusal.START, "cannot set out from where they are: something is in the way", world=inside)
    through = HOME.copy()
    through[9] = 0.1895
    refused(planner, Refusal.START, "the robot touches itself", q=through)


@pytest.mark.parametrize(
    "given",
    [
        {"q": np.full(15, np.nan)},
        {"q": np.zeros(14)},
        {"goals": np.zeros((0, 15))},
        {"goals": np.full(15, np.inf)},
        {"goals": np.zeros((2, 27))},
        {"speed": 0.0},
        {"hand_speed": -1.0},
    ],
)
def test_what_makes_no_sense_is_refused(planner: RrtConnect, given: dict[str, Any]) -> None:
    refused(planner, Refusal.BAD_INPUT, None, **given)


def test_a_joint_beyond_its_range_is_named(planner: RrtConnect) -> None:
    goal = READY.copy()
    goal[11] = 3.1
    refused(planner, Refusal.GOAL, "right_elbow_joint is 0.12. rad beyond the range", goals=goal)


def test_a_way_of_no_length_is_one(planner: RrtConnect) -> None:
    plan = planner.plan(PlanRequest(HOME, HOME, PACK))
    np.testing.assert_array_equal(plan.q, [HOME, HOME])
    assert plan.times[0] == 0.0 < plan.times[1]


def test_a_very_short_way_is_timed(planner: RrtConnect) -> None:
    goal = HOME.copy()
    goal[11] -= 1e-4
    plan = planner.plan(PlanRequest(HOME, goal, PACK))
    assert 0.0 < plan.times[-1] < 0.1 and (np.diff(plan.times) > 0.0).all()


def test_no_time_is_left(planner: RrtConnect) -> None:
    refused(planner, Refusal.NO_TIME, "No effort is left", effort=0)
    refused(planner, Refusal.NO_PATH, "allow more effort", effort=10, world=BARRED)


def test_it_can_be_stopped_at_every_stage(planner: RrtConnect, around: Plan) -> None:
    for allowed in (0, 1, 2, 5, 20, 60):
        asked = 0

        def stop(most: int = allowed) -> bool:
            nonlocal asked
            asked += 1
            return asked > most

        refused(planner, Refusal.STOPPED, "gave the plan up", world=BARRED, stop=stop)
        assert asked == allowed + 1


def test_nothing_reaches_a_target_that_is_too_far() -> None:
    finder = GoalPostures()
    assert len(finder.find(None, downward(1.0, -0.2, 0.1, -1.57), HOME, lambda q: True, random_starts=1)) == 0
    assert finder.nearest > 0.1


def test_a_cloud_of_ten_million_points(planner: RrtConnect) -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform((0.42, -1.0, -0.2), (1.2, 1.0, -0.1), (10_000_000, 3)).astype(np.float32)
    points[::100] = np.nan
    world = World(cloud=cloud_grid(points))
    plan = planner.plan(PlanRequest(HOME, READY, world))
    Q: Array = fine_points(plan.times, plan.q, plan.dq)
    assert not planner.robot.model().collides_each(Q, 0.0, world).any()
