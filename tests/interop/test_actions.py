"""Actions through every state, with ROS at either end."""

from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from tests.interop.peers import Ros, joined, until
from tests.interop.rows import cdr

from golem.middleware.ros.action_client import ActionClient
from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.codec import action
from golem.middleware.ros.future import RosError
from golem.middleware.ros.goals import CancelCode, GoalStatus
from golem.middleware.ros.node import RosNode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

NAME, PICK = "/skill/pick", "golem_interfaces/action/Pick"
Pick = action(PICK)
GOAL = {"name": NAME, "type": PICK, "goal": cdr(Pick.Goal("screw"))}


class Handler:
    """Keeps goals for the test to end."""

    def __init__(self) -> None:
        self.accepts = self.yields = True
        self.goals: list[ServerGoal] = []

    def decide(self, request: Any) -> bool:
        return self.accepts

    def accepted(self, goal: ServerGoal) -> None:
        self.goals.append(goal)
        goal.execute()

    def cancel(self, goal: ServerGoal) -> bool:
        return self.yields


@pytest.fixture
def handler(node: RosNode) -> Handler:
    handler = Handler()
    node.action_server(NAME, PICK, handler)
    return handler


def outcome(ros: Ros, node: RosNode) -> GoalStatus:
    return GoalStatus(ros.do("outcome", node, name=NAME)["status"])


def canceling(ros: Ros, node: RosNode, **words: Any) -> tuple[CancelCode, int]:
    answer = ros.do("cancel_id" if "id" in words else "cancel", node, name=NAME, **words)
    return CancelCode(answer["code"]), answer["goals"]


def test_a_client_of_ros_is_refused(node: RosNode, ros: Ros, handler: Handler) -> None:
    handler.accepts = False
    assert ros.do("give", node, **GOAL) == {"found": True, "answered": True, "accepted": False}


def test_a_client_of_ros_sees_its_goal_fail(node: RosNode, ros: Ros, handler: Handler) -> None:
    assert ros.do("give", node, **GOAL)["accepted"]
    handler.goals[0].abort(Pick.Result())
    assert outcome(ros, node) is GoalStatus.ABORTED


def test_a_client_of_ros_cancels(node: RosNode, ros: Ros, handler: Handler) -> None:
    assert ros.do("give", node, **GOAL)["accepted"]
    assert canceling(ros, node) == (CancelCode.NONE, 1)
    handler.goals[0].canceled(Pick.Result())
    assert outcome(ros, node) is GoalStatus.CANCELED
    assert canceling(ros, node) == (CancelCode.GOAL_TERMINATED, 0)


def test_a_client_of_ros_may_not_cancel(node: RosNode, ros: Ros, handler: Handler) -> None:
    handler.yields = False
    assert ros.do("give", node, **GOAL)["accepted"]
    assert canceling(ros, node) == (CancelCode.REJECTED, 0)
    handler.goals[0].succeed(Pick.Result())
    assert outcome(ros, node) is GoalStatus.SUCCEEDED


def test_a_client_of_ros_cancels_what_is_not_there_and_then_everything(
    node: RosNode, ros: Ros, handler: Handler
) -> None:
    assert canceling(ros, node, id="17" * 16) == (CancelCode.UNKNOWN_GOAL_ID, 0)
    assert ros.do("give", node, **GOAL)["accepted"]
    assert canceling(ros, node, id="00" * 16) == (CancelCode.NONE, 1)
    assert handler.goals[0].status is GoalStatus.CANCELING


def test_a_client_of_ros_that_dies_leaves_its_goal(node: RosNode, ros: Ros, handler: Handler, join: Any) -> None:
    assert ros.do("give", node, **GOAL)["accepted"]
    ros.kill()
    until(node, lambda: False, 0.5)
    handler.goals[0].feedback(Pick.Feedback())
    other = join()
    assert other.do("give", node, **GOAL)["accepted"]
    for goal in handler.goals:
        goal.succeed(Pick.Result())
    assert outcome(other, node) is GoalStatus.SUCCEEDED


def test_a_client_of_ros_sees_that_its_server_has_gone(node: RosNode, ros: Ros, domain: int) -> None:
    with joined(domain) as serving:
        serving.action_server(NAME, PICK, Handler())
        assert ros.do("give", serving, **GOAL)["accepted"]
    assert not ros.do("give", node, **GOAL)["found"]


class Theirs:
    """An action server of ROS, and our client of it."""

    def __init__(self, node: RosNode, ros: Ros) -> None:
        if ros.setup.vendor == "fastdds":
            pytest.skip("we do not call servers of Fast DDS")
        self.node, self.ros = node, ros
        words = {"feedback": cdr(Pick.Feedback()), "result": cdr(Pick.Result())}
        ros.do("act", node, name=NAME, type=PICK, **words)
        self.client: ActionClient = node.action_client(NAME, PICK)
        assert until(node, self.client.ready)

    def give(self, mode: str) -> Any:
        self.ros.do("mode", self.node, name=NAME, mode=mode)
        return self.node.wait(self.client.send_goal(Pick.Goal("screw")), 10.0)


@pytest.fixture
def theirs(node: RosNode, ros: Ros) -> Theirs:
    return Theirs(node, ros)


@pytest.mark.parametrize("mode,status", [("abort", GoalStatus.ABORTED), ("raise", GoalStatus.ABORTED)])
def test_a_server_of_ros_fails(theirs: Theirs, mode: str, status: GoalStatus) -> None:
    assert theirs.node.wait(theirs.give(mode).result(), 10.0).status is status


def test_a_server_of_ros_refuses(theirs: Theirs) -> None:
    assert not theirs.give("reject").accepted


def test_a_server_of_ros_is_told_to_cancel(theirs: Theirs) -> None:
    goal = theirs.give("wait")
    answer = theirs.node.wait(goal.cancel(), 10.0)
    assert (answer.code, answer.goals) == (CancelCode.NONE, (goal.id,))
    assert theirs.node.wait(goal.result(), 10.0).status is GoalStatus.CANCELED


def test_a_server_of_ros_that_will_not_cancel_agrees_to_nothing(theirs: Theirs) -> None:
    goal = theirs.give("stubborn")
    answer = theirs.node.wait(goal.cancel(), 10.0)
    # rclpy refuses by an empty list; rclcpp says REJECTED.
    assert answer.goals == ()
    theirs.ros.do("mode", theirs.node, name=NAME, mode="succeed")
    assert theirs.node.wait(goal.result(), 10.0).status is GoalStatus.SUCCEEDED


def test_a_server_of_ros_knows_no_goal_of_that_id(theirs: Theirs) -> None:
    answer = theirs.node.wait(theirs.client.cancel(bytes(range(16))), 10.0)
    assert (answer.code, answer.goals) == (CancelCode.UNKNOWN_GOAL_ID, ())


def test_a_server_of_ros_that_dies_is_missed(theirs: Theirs) -> None:
    result = theirs.give("wait").result()
    theirs.ros.kill()
    with pytest.raises(RosError, match="has gone"):
        theirs.node.wait(result, 30.0)
