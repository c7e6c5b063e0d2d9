"""The navigator on small maps: ways, moving obstacles, recoveries, and what it does when something is missing."""

from __future__ import annotations

import math

import numpy as np
import pytest
from tests.capabilities.navigation.rooms import ExactRobot, room, seen, wall_with_gap

from golem.capabilities.navigation.costmap_astar import CostmapAstar, CostmapAstarConfig
from golem.errors import ConfigError
from golem.finite import NotFinite
from golem.interfaces.nav_payloads import Scan
from golem.types import PlanarPose, Twist

GOAL = PlanarPose(6.0, 0.0, 0.0)


def off(robot: ExactRobot, goal: PlanarPose = GOAL) -> float:
    return math.hypot(robot.pose.x - goal.x, robot.pose.y - goal.y)


def test_it_goes_through_a_gap_and_touches_nothing() -> None:
    walls = wall_with_gap((0.6, 2.2))
    robot = ExactRobot(CostmapAstar(), room(*walls))
    step = robot.walk(GOAL, 60.0, lambda t: seen(t, *walls))
    assert step.arrived and robot.hits == 0
    assert off(robot) < 0.05 and abs(robot.pose.yaw) < 0.06
    assert any(step.twist.vy for step in robot.steps)


@pytest.mark.parametrize("heading", [math.pi, -2.0, 1.5])
def test_it_turns_before_it_walks_and_ends_with_the_heading_of_the_goal(heading: float) -> None:
    robot = ExactRobot(CostmapAstar(), room(), PlanarPose(0.0, 0.0, heading))
    goal = PlanarPose(3.0, 1.0, 2.0)
    step = robot.walk(goal, 60.0)
    assert step.arrived and robot.hits == 0 and off(robot, goal) < 0.05
    assert abs(math.remainder(robot.pose.yaw - 2.0, math.tau)) < 0.06


@pytest.mark.parametrize(
    ("boxes", "goal", "words"),
    [
        (((5.5, 6.5, -0.5, 0.5),), GOAL, "inside an obstacle"),
        ((), PlanarPose(40.0, 0.0, 0.0), "outside the map"),
        (wall_with_gap((3.0, 3.0)), GOAL, "no way"),
        (wall_with_gap((0.0, 0.5)), GOAL, "no way"),
    ],
)
def test_a_goal_that_cannot_be_reached_is_given_up_with_the_reason(
    boxes: tuple[tuple[float, float, float, float], ...], goal: PlanarPose, words: str
) -> None:
    robot = ExactRobot(CostmapAstar(CostmapAstarConfig(rounds=1, wait=0.5)), room(*boxes))
    step = robot.walk(goal, 60.0, lambda t: seen(t, *boxes))
    assert step.failure is not None and words in step.failure and robot.hits == 0
    assert step.twist == Twist()


def test_for_a_goal_outside_the_map_it_neither_waits_nor_moves() -> None:
    robot = ExactRobot(CostmapAstar(), room())
    step = robot.walk(PlanarPose(40.0, 0.0, 0.0), 60.0)
    assert step.failure == "The goal (40.00, 0.00) is outside the map."
    assert len(robot.steps) < 60 and all(step.twist == Twist() for step in robot.steps)


def test_what_is_not_in_the_map_is_gone_around() -> None:
    box = (2.6, 3.0, -0.6, 0.4)
    robot = ExactRobot(CostmapAstar(), room(box))
    step = robot.walk(GOAL, 60.0, lambda t: seen(t, box), grid=lambda t: EMPTY)
    assert step.arrived and robot.hits == 0


EMPTY = room()


def test_it_stops_for_somebody_in_the_way_and_goes_on_when_they_are_gone() -> None:
    narrow = wall_with_gap((-0.7, 0.7))
    person = (2.6, 2.9, -0.2, 0.2)
    robot = ExactRobot(CostmapAstar(), room(*narrow))

    def scan(t: float) -> Scan:
        return seen(t, *narrow, person) if 1.0 < t < 9.0 else seen(t, *narrow)

    step = robot.walk(GOAL, 90.0, scan)
    assert step.arrived and robot.hits == 0
    stood = [s for s in robot.steps if s.twist == Twist() and s.note in ("blocked", "recover", "wait")]
    assert stood


def test_somebody_who_stays_in_the_way_makes_it_give_up_after_its_recoveries() -> None:
    narrow = wall_with_gap((-0.7, 0.7))
    person = (2.6, 2.9, -0.2, 0.2)
    robot = ExactRobot(CostmapAstar(CostmapAstarConfig(rounds=2, wait=1.0)), room(*narrow, person))
    step = robot.walk(GOAL, 90.0, lambda t: seen(t, *narrow, person), grid=lambda t: BLIND)
    assert step.failure is not None and "gave up after 2 recoveries" in step.failure and robot.hits == 0
    assert {"recover", "blocked"} <= {s.note for s in robot.steps}


BLIND = room(*wall_with_gap((-0.7, 0.7)))


def test_a_scan_that_stays_away_stops_it_and_then_ends_the_walk() -> None:
    robot = ExactRobot(CostmapAstar(CostmapAstarConfig(lost=2.0)), room())
    step = robot.walk(GOAL, 30.0, lambda t: seen(min(t, 3.0)))
    assert step.failure is not None and "No new scan" in step.failure
    assert 5.0 < robot.t < 6.5
    assert all(s.twist == Twist() for s in robot.steps[-20:])


def test_a_short_gap_in_the_scans_stops_it_and_it_goes_on() -> None:
    robot = ExactRobot(CostmapAstar(), room())
    step = robot.walk(GOAL, 60.0, lambda t: seen(3.0 if 3.0 < t < 5.0 else t))
    assert step.arrived and any(s.note == "wait for scans" for s in robot.steps)


def test_without_a_map_or_a_lidar_it_says_what_is_missing() -> None:
    for scan, words in ((lambda t: None, "LiDAR"), (seen, "mapper")):
        robot = ExactRobot(CostmapAstar(CostmapAstarConfig(lost=1.0)), room())
        step = robot.walk(GOAL, 5.0, scan, grid=lambda t: None)
        assert step.failure is not None and words in step.failure


def test_a_robot_that_stands_close_to_a_wall_gets_away_from_it() -> None:
    robot = ExactRobot(CostmapAstar(), room((-1.0, 4.0, -1.0, -0.62)))
    step = robot.walk(PlanarPose(3.0, 1.5, 0.0), 60.0)
    assert step.arrived and robot.hits == 0


def test_of_two_ways_that_cost_the_same_it_goes_one_to_its_end() -> None:
    box = (2.4, 3.4, -0.6, 0.6)
    robot, rng = ExactRobot(CostmapAstar(), room(box)), np.random.default_rng(3)

    def shaken(t: float) -> Scan:
        robot.pose = robot.pose @ PlanarPose(0.0, float(rng.normal(0.0, 0.01)), 0.0)
        return seen(t, box)

    assert robot.walk(GOAL, 40.0, shaken).arrived and robot.hits == 0


def test_the_pose_must_be_finite() -> None:
    navigator = CostmapAstar()
    navigator.start(GOAL)
    robot = ExactRobot(navigator, room(), PlanarPose(float("nan"), 0.0, 0.0))
    with pytest.raises(NotFinite, match="pose"):
        robot.walk(GOAL, 0.1)


def test_wrong_options_are_refused() -> None:
    with pytest.raises(ConfigError, match="beta"):
        CostmapAstarConfig(beta=-1.0)
    assert np.isfinite(CostmapAstar.rate)
