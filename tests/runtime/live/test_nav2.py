"""The navigator nav2 beside an action server that speaks Nav2's types, on a domain of one process."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

pytest.importorskip("rosbags")

from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.nav2 import Nav2, Nav2Config
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavGoal, NavStep
from golem.middleware.bus import Bus
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.codec import action
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs import geometry_msgs
from golem.middleware.ros.node import RosNode
from golem.runtime.live.nav2_bridge import ACTION, TYPE, VELOCITY, Nav2Bridge
from golem.runtime.navigator_node import BusNav2
from golem.types import PlanarPose, Twist

GOAL = PlanarPose(2.0, 1.0, 0.5)


class FakeNav2:
    """Takes goals on and leaves them to the test."""

    def __init__(self, domain: LocalDomain) -> None:
        self.node = RosNode(domain.participant(), "bt_navigator")
        self.goals: list[ServerGoal] = []
        self.accepts = True
        self.node.action_server(ACTION, TYPE, self)
        self.velocity = self.node.publisher(VELOCITY, "geometry_msgs/msg/Twist")

    def decide(self, request: Any) -> bool:
        return self.accepts

    def accepted(self, goal: ServerGoal) -> None:
        goal.execute()
        self.goals.append(goal)

    def cancel(self, goal: ServerGoal) -> bool:
        return True

    def drive(self, vx: float, wz: float) -> None:
        linear, angular = geometry_msgs.Vector3(vx, 0.0, 0.0), geometry_msgs.Vector3(0.0, 0.0, wz)
        self.velocity.publish(geometry_msgs.Twist(linear, angular))


class Robot:
    """A stack's side: the navigator, its link, and the bridge."""

    def __init__(self, nav2: bool = True, config: Nav2Config | None = None) -> None:
        domain = self.domain = LocalDomain()
        self.nav2 = FakeNav2(domain) if nav2 else None
        self.bus, self.t = Bus(), 0.0
        self.node = RosNode(domain.participant(), "stack")
        self.bridge = Nav2Bridge(self.bus, self.node, lambda: self.t)
        self.navigator = Nav2(config, BusNav2(self.bus))
        self.pose = PlanarPose(0.0, 0.0, 0.0)

    def begin(self, goal: PlanarPose = GOAL) -> None:
        self.bus.publish(topics.NAV_GOAL, NavGoal(goal, "map"), self.t)
        self.navigator.start(goal)

    def step(self) -> NavStep:
        if self.nav2 is not None:
            self.nav2.node.poll()
        self.node.poll()
        self.bridge.step(self.t)
        self.t += 0.02
        return self.navigator.step(NavInputs(self.pose, False), 0.02)

    def until(self, condition: Callable[[NavStep], bool], steps: int = 400) -> NavStep:
        for _ in range(steps):
            step = self.step()
            if condition(step):
                return step
        raise AssertionError("it does not come to that")


def test_a_goal_goes_to_nav2_and_its_twists_come_back() -> None:
    robot = Robot()
    assert robot.nav2 is not None
    robot.begin()
    robot.until(lambda step: step.note == "nav2")
    (goal,) = robot.nav2.goals
    pose = goal.request.pose
    assert pose.header.frame_id == "map" and (pose.pose.position.x, pose.pose.position.y) == (2.0, 1.0)
    robot.nav2.drive(0.25, 5.0)
    step = robot.until(lambda step: step.twist != Twist())
    assert step.twist == Twist(0.25, 0.0, 0.6)  # within bounds
    stopped = robot.until(lambda step: step.twist == Twist())
    assert not stopped.ended  # a controller that falls silent stops the robot
    goal.succeed(action(TYPE).Result())
    robot.pose = PlanarPose(1.9, 1.1, 0.3)
    step = robot.until(lambda step: step.twist != Twist())
    assert step.left.x == pytest.approx(0.05, abs=0.1)  # the rest is goto's


def test_nav2_that_gives_up_or_refuses_ends_the_walk() -> None:
    robot = Robot()
    assert robot.nav2 is not None
    robot.begin()
    robot.until(lambda step: step.note == "nav2")
    robot.nav2.goals[0].abort(action(TYPE).Result(error_code=9000))
    assert "gave the goal up" in (robot.until(lambda step: step.ended).failure or "")
    robot.nav2.accepts = False
    robot.begin(PlanarPose(3.0, 0.0, 0.0))
    assert "refused" in (robot.until(lambda step: step.ended).failure or "")


def test_nav2_that_dies_is_missed_even_if_it_comes_back() -> None:
    robot = Robot(config=Nav2Config(patience=1.0))
    assert robot.nav2 is not None
    robot.begin()
    robot.until(lambda step: step.note == "nav2")
    dead, robot.nav2 = robot.nav2, None
    dead.node.close()
    robot.until(lambda step: step.note == "wait for nav2", 20)
    robot.nav2 = FakeNav2(robot.domain)
    step = robot.until(lambda step: step.ended, 60)
    assert "/navigate_to_pose" in (step.failure or "") and step.twist == Twist()


def test_without_nav2_it_says_what_is_missing() -> None:
    robot = Robot(nav2=False, config=Nav2Config(patience=1.0))
    robot.begin()
    failure = robot.until(lambda step: step.ended).failure
    assert failure is not None and "/navigate_to_pose" in failure and 0.9 < robot.t < 1.3


def test_arriving_somewhere_else_is_no_success() -> None:
    robot = Robot()
    assert robot.nav2 is not None
    robot.begin()
    robot.until(lambda step: step.note == "nav2")
    robot.nav2.goals[0].succeed(action(TYPE).Result())
    assert "m from the goal" in (robot.until(lambda step: step.ended).failure or "")


def test_a_skill_that_is_cancelled_cancels_the_goal_at_nav2() -> None:
    robot = Robot()
    assert robot.nav2 is not None
    robot.begin()
    robot.until(lambda step: step.note == "nav2")
    robot.bus.publish(topics.NAV_GOAL, NavGoal(None), robot.t)
    for _ in range(5):
        robot.step()
    assert robot.nav2.goals[0].status is GoalStatus.CANCELING


def test_another_goal_replaces_the_first() -> None:
    robot = Robot()
    assert robot.nav2 is not None
    robot.begin()
    robot.until(lambda step: step.note == "nav2")
    robot.begin(PlanarPose(-1.0, 0.0, 0.0))
    nav2 = robot.nav2
    robot.until(lambda step: len(nav2.goals) == 2)
    assert nav2.goals[0].status is GoalStatus.CANCELING
    assert nav2.goals[1].request.pose.pose.position.x == -1.0


def test_it_is_made_by_a_stack_only() -> None:
    with pytest.raises(ConfigError, match="stack"):
        Nav2()
