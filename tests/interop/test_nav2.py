"""The navigator nav2 beside an action server that rclpy runs, with the type that Nav2 has."""

from __future__ import annotations

import time
from collections.abc import Callable

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.interop.peers import PATIENCE, Ros
from tests.interop.rows import cdr

from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.nav2 import Nav2, Nav2Config
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavGoal, NavStep
from golem.middleware.bus import Bus
from golem.middleware.ros import codec
from golem.middleware.ros.msgs import geometry_msgs
from golem.middleware.ros.node import RosNode
from golem.runtime.live.nav2_bridge import ACTION, TYPE, VELOCITY, Nav2Bridge
from golem.runtime.navigator_node import BusNav2
from golem.types import PlanarPose, Twist

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

GOAL = PlanarPose(2.0, 1.0, 0.5)
PERIOD = 0.02


class Stack:
    """A stack's side, and Nav2 as rclpy runs it."""

    def __init__(self, node: RosNode, ros: Ros, patience: float = PATIENCE) -> None:
        if ros.setup.vendor == "fastdds":
            pytest.skip("we do not call servers of Fast DDS")
        self.node, self.ros, self.bus = node, ros, Bus()
        self.start = time.monotonic()
        self.bridge = Nav2Bridge(self.bus, node, self.now)
        self.navigator = Nav2(Nav2Config(patience=patience), BusNav2(self.bus))
        self.pose = PlanarPose(0.0, 0.0, 0.0)

    def now(self) -> float:
        """Return the time that has passed [s]."""
        return time.monotonic() - self.start

    def serve(self, mode: str) -> None:
        """Have rclpy offer the action."""
        action = codec.action(TYPE)
        words = {"feedback": cdr(action.Feedback()), "result": cdr(action.Result())}
        self.ros.do("act", self.node, name=ACTION, type=TYPE, **words)
        self.ros.do("mode", self.node, name=ACTION, mode=mode)

    def asked(self) -> int:
        """Return how many goals rclpy has begun to pursue."""
        return len(self.ros.do("asked", self.node, name=ACTION))

    def begin(self, goal: PlanarPose = GOAL) -> None:
        """Set off."""
        self.bus.publish(topics.NAV_GOAL, NavGoal(goal, "map"), self.now())
        self.navigator.start(goal)

    def until(self, condition: Callable[[NavStep], bool]) -> NavStep:
        """Step until `condition` of a step."""
        end = time.monotonic() + 2.0 * PATIENCE
        while time.monotonic() < end:
            self.node.spin_once(PERIOD)
            self.bridge.step(self.now())
            step = self.navigator.step(NavInputs(self.pose, False), PERIOD)
            if condition(step):
                return step
        raise AssertionError("it does not come to that")


def test_rclpy_gets_the_goal_drives_and_is_believed_when_it_has_arrived(node: RosNode, ros: Ros) -> None:
    stack = Stack(node, ros)
    stack.serve("wait")
    stack.begin()
    stack.until(lambda step: step.note == "nav2" and stack.asked() == 1)
    (asked,) = ros.do("asked", node, name=ACTION)
    pose = codec.deserialize(bytes.fromhex(asked), codec.action(TYPE).Goal).pose
    assert pose.header.frame_id == "map" and (pose.pose.position.x, pose.pose.position.y) == (2.0, 1.0)
    twist = geometry_msgs.Twist(geometry_msgs.Vector3(0.25, 0.1, 0.0), geometry_msgs.Vector3(0.0, 0.0, 0.2))
    ros.tell("publish", name=VELOCITY, type="geometry_msgs/msg/Twist", message=cdr(twist), count=50,
             reliable=True, transient_local=False, depth=1)  # fmt: skip
    assert stack.until(lambda step: step.twist != Twist()).twist == Twist(0.25, 0.1, 0.2)
    ros.hear(node)
    # Its controller falls silent: the robot stands, and the goal is still pursued.
    assert not stack.until(lambda step: step.twist == Twist()).ended
    stack.pose = PlanarPose(1.9, 1.1, 0.3)
    ros.do("mode", node, name=ACTION, mode="succeed")
    assert stack.until(lambda step: step.note != "nav2").left.x == pytest.approx(0.05, abs=0.1)


@pytest.mark.parametrize("mode, why", [("abort", "gave the goal up"), ("reject", "refused")])
def test_rclpy_that_gives_up_or_refuses_ends_the_walk(node: RosNode, ros: Ros, mode: str, why: str) -> None:
    stack = Stack(node, ros)
    stack.serve(mode)
    stack.begin()
    assert why in (stack.until(lambda step: step.ended).failure or "")


def test_a_walk_that_is_cancelled_is_cancelled_at_rclpy(node: RosNode, ros: Ros) -> None:
    stack = Stack(node, ros)
    stack.serve("wait")
    stack.begin()
    stack.until(lambda step: step.note == "nav2" and stack.asked() == 1)
    stack.bus.publish(topics.NAV_GOAL, NavGoal(None), stack.now())
    stack.bridge.step(stack.now())
    # rclpy waits with each goal until it is cancelled: it has ended the first one, and takes the next.
    stack.begin(PlanarPose(1.0, 0.0, 0.0))
    stack.until(lambda step: stack.asked() == 2)
    assert not stack.until(lambda step: step.note == "nav2").ended


def test_without_a_server_it_says_so(node: RosNode, ros: Ros) -> None:
    stack = Stack(node, ros, patience=2.0)
    stack.begin()
    assert "/navigate_to_pose" in (stack.until(lambda step: step.ended).failure or "")
