"""What a callback raises is answered for and logged once, and whoever polls the node goes on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("rosbags")

from golem.errors import ConfigError
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.action_server import ServerGoal
from golem.middleware.ros.callback_guard import REMEMBERED, CallbackGuard
from golem.middleware.ros.codec import action
from golem.middleware.ros.goals import CancelCode, GoalStatus
from golem.middleware.ros.msgs.std_msgs import String
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, SetBool_Response
from golem.middleware.ros.node import RosNode

from .conftest import PICK, SET_BOOL, STRING

Pick = action(PICK)


class Nodes:
    """A node whose callbacks raise, and one that talks to it."""

    def __init__(self) -> None:
        domain = LocalDomain()
        self.logged: list[str] = []
        self.server = RosNode(domain.participant(), "server", log=self.logged.append)
        self.client = RosNode(domain.participant(), "client")

    def spin(self) -> None:
        for _ in range(5):
            self.server.poll()
            self.client.poll()


@pytest.fixture
def nodes() -> Iterator[Nodes]:
    nodes = Nodes()
    yield nodes
    nodes.server.close()
    nodes.client.close()


def broken(*_: Any) -> Any:
    raise ZeroDivisionError("by zero")


def test_a_subscription_goes_on_and_its_error_is_logged_once_with_its_place(nodes: Nodes) -> None:
    nodes.server.subscription("/words", STRING, broken)
    words = nodes.client.publisher("/words", STRING)
    for _ in range(3):
        words.publish(String("a"))
    nodes.spin()
    assert nodes.server.guard.count == 3 and len(nodes.logged) == 1
    assert nodes.logged[0].startswith("Topic 'rt/words' failed: ZeroDivisionError: by zero\nTraceback")
    assert "in broken" in nodes.logged[0]


@pytest.mark.parametrize(
    ("callback", "message"),
    [
        (broken, "Service '/set' failed: ZeroDivisionError: by zero"),
        (lambda _: None, "takes a std_srvs/srv/SetBool_Response here, not NoneType."),
        (lambda _: SetBool_Response(True, "\ud800"), "cannot be serialised"),
    ],
)
def test_a_service_answers_why_it_failed(nodes: Nodes, callback: Any, message: str) -> None:
    nodes.server.service("/set", SET_BOOL, callback)
    answer = nodes.client.client("/set", SET_BOOL).call(SetBool_Request(True))
    nodes.spin()
    assert not answer.result().success and message in answer.result().message


def test_what_a_user_can_cause_is_answered_and_not_logged(nodes: Nodes) -> None:
    def refuses(_: Any) -> Any:
        raise ConfigError("Only on weekdays.")

    nodes.server.service("/set", SET_BOOL, refuses)
    answer = nodes.client.client("/set", SET_BOOL).call(SetBool_Request(True))
    nodes.spin()
    assert answer.result().message == "Only on weekdays." and nodes.logged == []


class Handler:
    """Raises in one of its methods."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.goals: list[ServerGoal] = []

    def decide(self, request: Any) -> bool:
        return broken() if self.where == "decide" else True

    def accepted(self, goal: ServerGoal) -> None:
        self.goals.append(goal)
        if self.where != "accepted, at once":
            goal.execute()
        if self.where.startswith("accepted"):
            broken()

    def cancel(self, goal: ServerGoal) -> bool:
        return broken()


def test_a_goal_about_which_nobody_could_decide_is_rejected(nodes: Nodes) -> None:
    nodes.server.action_server("/pick", PICK, Handler("decide"))
    goal = nodes.client.action_client("/pick", PICK).send_goal(Pick.Goal())
    nodes.spin()
    assert not goal.result().accepted and "Action '/pick' failed" in nodes.logged[0]


@pytest.mark.parametrize("where", ["accepted", "accepted, at once"])
def test_a_goal_that_its_handler_fails_to_begin_is_aborted(nodes: Nodes, where: str) -> None:
    nodes.server.action_server("/pick", PICK, Handler(where))
    goal = nodes.client.action_client("/pick", PICK).send_goal(Pick.Goal())
    nodes.spin()
    outcome = goal.result().result()
    nodes.spin()
    assert outcome.result().status is GoalStatus.ABORTED


def test_a_cancellation_that_fails_is_declined(nodes: Nodes) -> None:
    nodes.server.action_server("/pick", PICK, handler := Handler("cancel"))
    goal = nodes.client.action_client("/pick", PICK).send_goal(Pick.Goal())
    nodes.spin()
    canceling = goal.result().cancel()
    nodes.spin()
    assert canceling.result().code is CancelCode.REJECTED
    assert handler.goals[0].status is GoalStatus.EXECUTING


def test_an_answer_whose_reader_raises_ends_nobody(nodes: Nodes) -> None:
    nodes.client.service("/set", SET_BOOL, lambda _: SetBool_Response(True))
    nodes.server.client("/set", SET_BOOL).call(SetBool_Request()).then(broken)
    nodes.spin()
    assert nodes.server.guard.count == 1


def test_an_interrupt_is_let_through() -> None:
    def interrupt() -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        CallbackGuard().call("x", interrupt)


def test_errors_without_end_fill_no_memory() -> None:
    logged: list[str] = []
    guard = CallbackGuard(logged.append)
    for i in range(2 * REMEMBERED):
        guard.call(f"topic {i}", broken)
    assert len(logged) == REMEMBERED and guard.count == 2 * REMEMBERED
    assert len(guard.caught("x", ValueError("y" * 10**6))) < 400
