"""What action servers and clients do, whatever carries them: friendly clients, hostile clients, deaths and returns."""

from __future__ import annotations

import gc
import weakref
from typing import Any

import pytest

pytest.importorskip("rosbags")

from golem.middleware.dds.base import ENCAPSULATION, LATCHED, Qos
from golem.middleware.ros.action_client import ActionClient
from golem.middleware.ros.action_server import ActionServer, ServerGoal
from golem.middleware.ros.codec import action, dds_name
from golem.middleware.ros.future import RosError
from golem.middleware.ros.goals import STATUS_ARRAY, CancelCode, GoalStatus
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.golem_interfaces import SkillFeedback, SkillResult
from golem.middleware.ros.node import RosNode

from .conftest import PICK, World

Pick = action(PICK)


class Handler:
    """Takes goals on and leaves them to the test."""

    def __init__(self) -> None:
        self.accepts, self.yields = True, True
        self.goals: list[ServerGoal] = []
        self.finish = False

    def decide(self, request: Any) -> bool:
        return self.accepts

    def accepted(self, goal: ServerGoal) -> None:
        self.goals.append(goal)
        if self.finish:
            goal.execute()
            goal.succeed(result(goal.request.label))

    def cancel(self, goal: ServerGoal) -> bool:
        return self.yields


class Pair:
    """A server, a client, and what is between them."""

    def __init__(self, world: World) -> None:
        self.world, self.handler = world, Handler()
        self.server_node, self.server = self.serve()
        self.client_node, self.client = self.join("client")

    def serve(self) -> tuple[RosNode, ActionServer]:
        node = self.world.node("server")
        return node, node.action_server("/skill/pick", PICK, self.handler, result_timeout=10.0)

    def join(self, name: str) -> tuple[RosNode, ActionClient]:
        node = self.world.node(name)
        client = node.action_client("/skill/pick", PICK)
        self.world.until(client.ready)
        return node, client

    def send(self, label: str = "screw", **options: Any) -> tuple[Any, ServerGoal]:
        """Have a goal accepted; return it as the client and as the server see it."""
        goal = self.world.get(self.client.send_goal(Pick.Goal(label), **options))
        assert goal.accepted
        return goal, self.handler.goals[-1]


@pytest.fixture
def pair(world: World) -> Pair:
    return Pair(world)


def result(reason: str) -> Any:
    return Pick.Result(SkillResult(success=True, reason=reason))


def feedback(text: str) -> Any:
    return Pick.Feedback(SkillFeedback(text=text))


def test_a_goal_from_proposal_to_result(pair: Pair) -> None:
    heard: list[str] = []
    goal, work = pair.send("bolt", feedback=lambda f: heard.append(f.feedback.text))
    assert work.request.label == "bolt" and work.id == goal.id
    assert work.status is GoalStatus.ACCEPTED and pair.server.goals() == [work]
    pair.world.until(lambda: goal.status is GoalStatus.ACCEPTED)
    outcome = goal.result()
    work.execute()
    pair.world.until(lambda: goal.status is GoalStatus.EXECUTING)
    for text in ("detect", "grasp"):
        work.feedback(feedback(text))
    pair.world.until(lambda: heard == ["detect", "grasp"])
    assert not outcome.done
    work.succeed(result("held"))
    ended = pair.world.get(outcome)
    assert ended.status is GoalStatus.SUCCEEDED and ended.result.result.reason == "held"
    assert goal.status is GoalStatus.SUCCEEDED and pair.server.goals() == []


def test_a_goal_may_be_refused(pair: Pair) -> None:
    pair.handler.accepts = False
    goal = pair.world.get(pair.client.send_goal(Pick.Goal("screw")))
    assert not goal.accepted and goal.status is GoalStatus.UNKNOWN
    assert pair.handler.goals == [] and pair.server.goals() == []
    assert pair.world.get(goal.result()).status is GoalStatus.UNKNOWN
    assert pair.world.get(goal.cancel()).code is CancelCode.UNKNOWN_GOAL_ID


def test_a_goal_may_fail(pair: Pair) -> None:
    goal, work = pair.send()
    with pytest.raises(RosError, match="'abort' cannot happen to it"):
        work.abort(result("too early"))
    work.execute()
    work.abort(result("lost"))
    ended = pair.world.get(goal.result())
    assert (ended.status, ended.result.result.reason) == (GoalStatus.ABORTED, "lost")
    with pytest.raises(RosError, match="is aborted"):
        work.succeed(result("no"))
    with pytest.raises(RosError, match="no feedback"):
        work.feedback(feedback("late"))


def test_messages_of_other_types_are_refused(pair: Pair) -> None:
    _, work = pair.send()
    work.execute()
    for call in (work.succeed, work.feedback, pair.client.send_goal):
        with pytest.raises(CodecError, match="takes a golem_interfaces/action/Pick"):
            call(SkillResult())
    assert work.status is GoalStatus.EXECUTING


def test_cancelling_is_asked_for_and_then_done(pair: Pair) -> None:
    goal, work = pair.send()
    work.execute()
    answer = pair.world.get(goal.cancel())
    assert (answer.code, answer.goals) == (CancelCode.NONE, (goal.id,))
    assert work.status is GoalStatus.CANCELING
    pair.world.until(lambda: goal.status is GoalStatus.CANCELING)
    again = pair.world.get(goal.cancel())
    assert (again.code, again.goals) == (CancelCode.GOAL_TERMINATED, ())
    work.feedback(feedback("letting go"))
    work.canceled(result("let go"))
    assert pair.world.get(goal.result()).status is GoalStatus.CANCELED
    assert pair.world.get(goal.cancel()).code is CancelCode.GOAL_TERMINATED


def test_a_goal_may_be_cancelled_before_it_is_executed(pair: Pair) -> None:
    goal, work = pair.send()
    assert pair.world.get(goal.cancel()).code is CancelCode.NONE
    with pytest.raises(RosError, match="'execute' cannot happen"):
        work.execute()
    work.canceled(result(""))
    assert pair.world.get(goal.result()).status is GoalStatus.CANCELED


def test_a_canceling_goal_may_still_succeed(pair: Pair) -> None:
    goal, work = pair.send()
    work.execute()
    pair.world.get(goal.cancel())
    work.succeed(result("was done already"))
    assert pair.world.get(goal.result()).status is GoalStatus.SUCCEEDED


def test_the_server_may_refuse_to_cancel(pair: Pair) -> None:
    pair.handler.yields = False
    goal, work = pair.send()
    work.execute()
    answer = pair.world.get(goal.cancel())
    assert (answer.code, answer.goals) == (CancelCode.REJECTED, ())
    assert work.status is GoalStatus.EXECUTING


def test_a_handler_may_end_a_goal_when_asked_to_cancel_it(pair: Pair) -> None:
    goal, work = pair.send()
    other, other_work = pair.send()
    for each in (work, other_work):
        each.execute()

    def end_both(goal: ServerGoal) -> bool:
        for each in pair.server.goals():
            each.succeed(result("just done"))
        return True

    pair.handler.cancel = end_both
    answer = pair.world.get(pair.client.cancel())
    assert (answer.code, answer.goals) == (CancelCode.REJECTED, ())
    assert pair.world.get(other.result()).status is GoalStatus.SUCCEEDED


def test_cancel_before_the_goal_means_nothing_to_the_server(pair: Pair) -> None:
    id = bytes(range(16))
    early = pair.client.cancel(id)
    sent = pair.client.send_goal(Pick.Goal("screw"), id=id)
    assert pair.world.get(early).code is CancelCode.UNKNOWN_GOAL_ID
    assert pair.world.get(sent).accepted


def test_all_goals_or_the_older_ones_can_be_cancelled_at_once(pair: Pair) -> None:
    goals: list[Any] = []
    for t in (100.0, 101.0, 102.0):
        pair.world.clock.t = t
        goals.append(pair.send()[0])
    ids = [g.id for g in goals]
    assert pair.world.get(pair.client.cancel(before=100.5)).goals == (ids[0],)
    assert pair.world.get(pair.client.cancel()).goals == (ids[1], ids[2])
    everything = pair.world.get(pair.client.cancel())
    assert (everything.code, everything.goals) == (CancelCode.NONE, ())


def test_two_goals_run_side_by_side(pair: Pair) -> None:
    heard: dict[str, list[str]] = {"a": [], "b": []}
    first, work_a = pair.send("a", feedback=lambda f: heard["a"].append(f.feedback.text))
    second, work_b = pair.send("b", feedback=lambda f: heard["b"].append(f.feedback.text))
    for work in (work_a, work_b):
        work.execute()
        work.feedback(feedback(work.request.label))
    work_b.succeed(result("b"))
    assert pair.world.get(second.result()).result.result.reason == "b"
    work_a.abort(result("a"))
    assert pair.world.get(first.result()).status is GoalStatus.ABORTED
    assert heard == {"a": ["a"], "b": ["b"]}


def test_an_id_is_used_once(pair: Pair) -> None:
    goal, _ = pair.send(id=b"0123456789abcdef")
    _, stranger = pair.join("stranger")
    assert not pair.world.get(stranger.send_goal(Pick.Goal("x"), id=goal.id)).accepted
    for id in (goal.id, b"short", bytes(16)):
        with pytest.raises(RosError, match="id of its own"):
            pair.client.send_goal(Pick.Goal("x"), id=id)
    assert len(pair.server.goals()) == 1


def test_a_stranger_hears_the_result_but_not_the_feedback(pair: Pair) -> None:
    goal, work = pair.send()
    _, stranger = pair.join("stranger")
    assert pair.world.get(stranger.cancel(goal.id)).code is CancelCode.NONE
    work.feedback(feedback("not for strangers"))
    work.canceled(result("stopped by a stranger"))
    assert pair.world.get(goal.result()).status is GoalStatus.CANCELED


def test_a_result_is_kept_for_a_while(pair: Pair) -> None:
    goal, work = pair.send()
    work.execute()
    work.succeed(result("here"))
    pair.world.clock.t += 9.0
    pair.world.settle()
    assert pair.world.get(goal.result()).result.result.reason == "here"
    pair.world.clock.t += 2.0
    pair.world.settle()
    late = pair.world.get(goal.result())
    assert late.status is GoalStatus.UNKNOWN and late.result == Pick.Result()


def test_a_long_goal_keeps_its_result_from_its_end(pair: Pair) -> None:
    goal, work = pair.send()
    work.execute()
    pair.world.clock.t += 3600.0
    work.succeed(result("after an hour"))
    assert pair.world.get(goal.result()).result.result.reason == "after an hour"


def test_a_client_that_dies_does_not_stop_its_goal(pair: Pair) -> None:
    goal, work = pair.send()
    goal.result()
    work.execute()
    pair.world.kill(pair.client_node)
    pair.world.settle()
    work.feedback(feedback("anybody there?"))
    work.succeed(result("nobody"))
    pair.world.settle()
    _, heir = pair.join("heir")
    assert pair.world.get(heir.send_goal(Pick.Goal("next"))).accepted


def test_a_server_that_dies_fails_its_goals_and_may_return(pair: Pair) -> None:
    goal, work = pair.send()
    work.execute()
    outcome = goal.result()
    pair.world.settle()
    pair.world.kill(pair.server_node)
    with pytest.raises(RosError, match="server of '/skill/pick/_action/get_result' has gone"):
        pair.world.get(outcome)
    with pytest.raises(RosError, match="No server"):
        pair.client.send_goal(Pick.Goal("screw")).result()
    pair.serve()
    pair.world.until(pair.client.ready)
    assert pair.world.get(goal.result()).status is GoalStatus.UNKNOWN
    pair.handler.finish = True
    assert pair.send("again")[0].accepted


def test_a_clock_that_jumps_back_stops_nothing(pair: Pair) -> None:
    goal, work = pair.send()
    pair.world.clock.t = 0.0
    work.execute()
    work.succeed(result("then"))
    assert pair.world.get(goal.result()).status is GoalStatus.SUCCEEDED
    pair.world.clock.t = 10.0
    pair.world.settle()
    assert pair.world.get(goal.result()).status is GoalStatus.UNKNOWN


def test_a_thousand_goals_at_once_and_nothing_is_left(pair: Pair) -> None:
    pair.handler.finish = True
    sent = [pair.client.send_goal(Pick.Goal(f"{i}")) for i in range(1000)]
    pair.world.until(lambda: all(f.done for f in sent))
    outcomes = [f.result().result() for f in sent]
    pair.world.until(lambda: all(f.done for f in outcomes))
    assert [f.result().result.result.reason for f in outcomes] == [f"{i}" for i in range(1000)]
    seen = [weakref.ref(each) for each in (*pair.handler.goals, *(f.result() for f in sent))]
    pair.handler.goals.clear()
    pair.world.clock.t += 11.0
    pair.world.settle()
    sent.clear()
    outcomes.clear()
    gc.collect()
    assert [ref for ref in seen if ref() is not None] == []
    late = pair.world.node("late").subscription("/skill/pick/_action/status", STATUS_ARRAY, qos=LATCHED)
    pair.world.until(lambda: late.count() > 0)
    newest = late.latest()
    assert newest is not None and newest.status_list == []


def test_a_flood_of_goals_does_not_repeat_their_status_at_every_goal(pair: Pair) -> None:
    pair.handler.finish = True
    told = pair.world.node("watch").subscription("/skill/pick/_action/status", STATUS_ARRAY)
    pair.world.until(lambda: told.matched() > 0)
    for i in range(300):
        pair.client.send_goal(Pick.Goal(f"{i}"))
        pair.world.spin()
    pair.world.settle()
    assert 0 < told.count() < 100


def test_requests_that_are_none_do_no_harm(pair: Pair) -> None:
    stranger = pair.world.participant(pair.world.node("stranger"))
    parts = {
        "send_goal": f"{PICK}_SendGoal",
        "cancel_goal": "action_msgs/srv/CancelGoal",
        "get_result": f"{PICK}_GetResult",
    }
    writers = [
        stranger.writer(f"rq/skill/pick/_action/{part}Request", dds_name(f"{kind}_Request"), Qos())
        for part, kind in parts.items()
    ]
    writers += [
        stranger.writer("rt/skill/pick/_action/feedback", dds_name(f"{PICK}_FeedbackMessage"), Qos()),
        stranger.writer("rt/skill/pick/_action/status", dds_name(STATUS_ARRAY), LATCHED),
    ]
    pair.world.until(lambda: all(w.matched() == 1 for w in writers))
    for writer in writers:
        for body in (bytes(1), bytes(36), b"\xff" * 64, b"\x7f" * 200):
            writer.write(ENCAPSULATION + body)
    pair.world.settle()
    assert pair.send()[0].accepted
