"""Skills as actions across a domain: one at a time, with feedback, cancelled, stopped, refused with a reason."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from tests.runtime.live.conftest import Live

from golem.interfaces import public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import HandGoal
from golem.middleware.ros.base import ClientGoal
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.geometry_msgs import PoseStamped
from golem.middleware.ros.msgs.golem_interfaces import (
    Pick_Goal,
    SetForce_Request,
    SetGap_Request,
    Stand_Goal,
    Walk_Goal,
)
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import DdsNode
from golem.runtime.live.velocity import LET_GO
from golem.skills.base import SkillResult
from golem.types import TICK, Twist


@dataclass
class Client:
    """Somebody who gives goals, in simulated time."""

    live: Live
    node: DdsNode
    said: list[str] = field(default_factory=list)

    def until(self, condition: Callable[[], bool], seconds: float = 2.0) -> None:
        """Let time pass until `condition()`."""
        end = self.live.clock + seconds
        while not condition():
            assert self.live.clock < end, "nothing happened"
            self.live.run(TICK)
            self.node.poll()

    def send(self, action: str, goal: Any) -> ClientGoal:
        """Give a goal, and return it once it was decided about."""
        kind = next(row.type for row in public.ACTIONS if row.name == action)
        client = self.node.action_client(action, kind)
        self.until(client.ready)
        future = client.send_goal(goal, lambda message: self.said.append(message.feedback.text))
        self.until(lambda: future.done)
        assert future.result().accepted
        return future.result()

    def outcome(self, goal: ClientGoal, seconds: float = 2.0) -> tuple[GoalStatus, Any]:
        """Wait for the end of a goal; return its status and its result."""
        future = goal.result()
        self.until(lambda: future.done, seconds)
        return future.result().status, future.result().result.result

    def call(self, name: str, request: Any) -> Any:
        """Call a service of the stack."""
        client = self.node.client(name, next(row.type for row in public.SERVICES if row.name == name))
        self.until(client.ready)
        future = client.call(request)
        self.until(lambda: future.done)
        return future.result()


@pytest.fixture
def client(live: Live) -> Client:
    """Somebody on the domain of a robot that may move."""
    live.activate()
    live.run(0.02)  # the stack hears of it
    return Client(live, live.member("client")[1])


def stand(seconds: float) -> Stand_Goal:
    return Stand_Goal(convert.duration(seconds))


def test_a_goal_is_pursued_to_its_end(client: Client) -> None:
    goal = client.send("/skill/stand", stand(0.2))
    status, result = client.outcome(goal)
    assert (status, result.success, result.stage) == (GoalStatus.SUCCEEDED, True, "done")
    assert client.said == ["Standing for 0.2 s."]
    assert [t.name for t in result.timings] == ["stand"] and result.timings[0].seconds == pytest.approx(
        0.2, abs=0.02
    )


def test_a_second_goal_is_refused_with_the_reason_and_the_first_goes_on(client: Client) -> None:
    first = client.send("/skill/stand", stand(0.3))
    status, result = client.outcome(client.send("/skill/stand", stand(0.1)))
    assert status is GoalStatus.ABORTED and "Another skill is running" in result.reason
    assert client.outcome(first)[0] is GoalStatus.SUCCEEDED


def test_velocities_from_elsewhere_wait_while_a_skill_has_the_robot(client: Client) -> None:
    live, row = client.live, public.topic("/cmd_vel")
    assert live.up is not None and live.up.side is not None
    velocity = client.node.publisher(row.name, row.type, row.qos)

    def drive(twist: Twist) -> None:
        velocity.publish(convert.twist(twist))
        live.run(0.02)

    goal = client.send("/skill/stand", stand(0.2))
    drive(Twist(0.3))
    assert live.up.side.bus.latest(topics.TWIST) == Twist()  # the skill's
    assert client.outcome(goal)[0] is GoalStatus.SUCCEEDED
    drive(Twist(0.3))
    assert live.up.side.bus.latest(topics.TWIST) == Twist()  # somebody still holds the joystick
    drive(Twist())
    drive(Twist(0.3))
    assert live.up.side.bus.latest(topics.TWIST) == Twist(0.3)


def test_a_joystick_that_is_held_does_not_move_a_robot_that_is_released(client: Client) -> None:
    live, row = client.live, public.topic("/cmd_vel")
    assert live.up is not None and live.up.side is not None
    velocity = client.node.publisher(row.name, row.type, row.qos)
    bus = live.up.side.bus

    def hold(seconds: float) -> None:
        end = live.clock + seconds
        while live.clock < end:
            velocity.publish(convert.twist(Twist(0.3)))
            live.run(0.05)

    live.ask("stop")
    live.run(0.1)
    hold(0.5)
    live.ask("reset")
    hold(0.1)
    live.activate()
    hold(0.5)
    assert bus.latest(topics.TWIST) is None
    live.run(LET_GO + 0.1)
    hold(0.1)
    assert bus.latest(topics.TWIST) == Twist(0.3)


def test_a_cancelled_skill_ends_as_cancelled_and_makes_room(client: Client) -> None:
    goal = client.send("/skill/stand", stand(5.0))
    canceling = goal.cancel()
    client.until(lambda: canceling.done)
    status, result = client.outcome(goal)
    assert (status, result.stage) == (GoalStatus.CANCELED, "cancelled")
    assert client.outcome(client.send("/skill/stand", stand(0.05)))[0] is GoalStatus.SUCCEEDED


def test_a_stopped_robot_aborts_its_skill_and_begins_none(client: Client) -> None:
    goal = client.send("/skill/stand", stand(5.0))
    client.live.ask("stop")
    status, result = client.outcome(goal)
    assert (status, result.slot) == (GoalStatus.ABORTED, "safety") and "stop_requested" in result.reason
    status, result = client.outcome(client.send("/skill/stand", stand(0.1)))
    assert status is GoalStatus.ABORTED and "stop_requested" in result.reason


def test_a_robot_that_falls_silent_aborts_its_skill_and_begins_none(client: Client) -> None:
    live = client.live
    goal = client.send("/skill/stand", stand(5.0))
    twin, live.twin = live.twin, None  # its clock stands still, and with it everything that goes by it
    status, result = client.outcome(goal, 4.0)
    assert (status, result.stage) == (GoalStatus.ABORTED, "robot") and "silent" in result.reason
    status, result = client.outcome(client.send("/skill/stand", stand(0.1)))
    assert (status, result.stage) == (GoalStatus.ABORTED, "refused") and "silent" in result.reason
    live.twin = twin
    live.run(0.2)
    live.ask("reset")
    live.activate()
    live.run(0.02)
    status, result = client.outcome(client.send("/skill/stand", stand(0.1)))
    assert status is GoalStatus.SUCCEEDED, result.reason


def test_a_robot_that_is_started_anew_aborts_its_skill(client: Client) -> None:
    goal = client.send("/skill/stand", stand(50.0))
    client.live.leave("twin")
    client.live.run(0.02)
    client.live.start_twin(seed=1)
    status, result = client.outcome(goal)
    assert status is GoalStatus.ABORTED and "started anew" in result.reason


@pytest.mark.parametrize(
    ("action", "goal", "reason"),
    [
        ("/skill/pick", Pick_Goal("screw", "tray", "middle"), "'left' or 'right'"),
        ("/skill/pick", Pick_Goal("", "tray", "left"), "names a label"),
        ("/skill/walk", Walk_Goal(PoseStamped(convert.header(0.0, "map"))), "odom or base_link"),
    ],
)
def test_a_goal_without_sense_is_refused_with_the_reason(
    client: Client, action: str, goal: Any, reason: str
) -> None:
    status, result = client.outcome(client.send(action, goal))
    assert (status, result.stage) == (GoalStatus.ABORTED, "refused") and reason in result.reason


def test_hands_obey_services_while_the_gate_is_open(client: Client) -> None:
    side = client.live.up and client.live.up.side
    assert side is not None

    def goal() -> HandGoal | None:
        return side.bus.latest(topics.hand_goal("left"))

    assert client.call("/left/gripper/set_position", SetGap_Request(0.03)).success and goal() == HandGoal(
        0.03
    )
    assert client.call("/left/gripper/set_force", SetForce_Request(5.0)).success and goal() == HandGoal(
        None, 5.0
    )
    assert (
        "between 0 and 0.108 m"
        in client.call("/left/gripper/set_position", SetGap_Request(float("nan"))).message
    )
    client.live.ask("stop")
    client.live.run(0.02)
    answer = client.call("/left/gripper/open", Trigger_Request())
    assert not answer.success and "gate is shut" in answer.message


def test_a_skill_that_outlives_its_goal_is_ended(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    from golem.runtime.live import skill_action_server

    class Forever:
        name = "forever"

        async def run(self, context: Any, goal: Any) -> SkillResult:
            await context.sleep(1e6)
            return SkillResult(True, "done", None, "")

    offer = skill_action_server.OFFERS["/skill/stand"]
    hangs = replace(offer, make=lambda stack: Forever(), allowance=lambda goal: 0.1)
    monkeypatch.setitem(skill_action_server.OFFERS, "/skill/stand", hangs)
    client.live.leave("up")
    client.live.start_up()
    client.live.run(0.1)
    client.live.ask("reset")
    client.live.ask("activate")
    client.live.run(0.02)
    status, result = client.outcome(client.send("/skill/stand", stand(1.0)))
    assert (status, result.stage) == (GoalStatus.ABORTED, "timeout")
