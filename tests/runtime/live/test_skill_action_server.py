"""Skills as actions across a domain: one at a time, with feedback, cancelled, stopped, refused with a reason."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest
from tests.runtime.live.conftest import Live

from golem import registry
from golem.interfaces import public, topics
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import HandGoal
from golem.middleware.ros.action_client import ClientGoal
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.msgs.geometry_msgs import PoseStamped
from golem.middleware.ros.msgs.golem_interfaces import (
    Pick_Goal,
    RunSkill_Goal,
    SetForce_Request,
    SetGap_Request,
    Stand_Goal,
    Walk_Goal,
)
from golem.middleware.ros.msgs.std_srvs import Trigger_Request
from golem.middleware.ros.node import RosNode
from golem.runtime.live.skill_messages import read_list
from golem.runtime.live.stack_process import LET_GO
from golem.skills.spec import schema_of, with_ranges
from golem.skills.walk import WalkGoal
from golem.stack import Choice
from golem.types import TICK, Twist


@dataclass
class Client:
    """Somebody who gives goals, in simulated time."""

    live: Live
    node: RosNode
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


def test_who_began_a_skill_has_the_lease_until_he_leaves_or_it_is_taken(client: Client, live: Live) -> None:
    client.outcome(client.send("/skill/stand", stand(0.1)))
    second = Client(live, live.member("second")[1])
    _, refused = second.outcome(second.send("/skill/stand", stand(0.1)))
    assert refused.stage == "refused" and "has the lease for skills" in refused.reason
    assert second.call("/skill/take_over", Trigger_Request()).success
    status, _ = second.outcome(second.send("/skill/stand", stand(0.1)))
    assert status is GoalStatus.SUCCEEDED
    _, refused = client.outcome(client.send("/skill/stand", stand(0.1)))
    assert refused.stage == "refused"
    live.leave_quietly(second.node)
    live.run(0.1)
    status, _ = client.outcome(client.send("/skill/stand", stand(0.1)))
    assert status is GoalStatus.SUCCEEDED


def test_a_goal_is_pursued_to_its_end(client: Client) -> None:
    goal = client.send("/skill/stand", stand(0.2))
    status, result = client.outcome(goal)
    assert (status, result.success, result.stage) == (GoalStatus.SUCCEEDED, True, "done")
    assert client.said == ["Standing for 0.2 s."]
    assert [t.name for t in result.timings] == ["stand"] and result.timings[0].seconds == pytest.approx(0.2, abs=0.02)


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


def test_a_height_stays_with_the_velocities_that_follow_and_ends_with_a_skill(client: Client) -> None:
    live, rows = client.live, [public.topic(name) for name in ("/cmd_vel", "/cmd_height")]
    assert live.up is not None and live.up.side is not None
    bus, (velocity, height) = live.up.side.bus, [client.node.publisher(r.name, r.type, r.qos) for r in rows]

    def drive(twist: Twist | None, up: float | None = None) -> Twist | None:
        if twist is not None:
            velocity.publish(convert.twist(twist))
        if up is not None:
            height.publish(convert.cmd_height(Twist(height=up)))
        live.run(0.02)
        return bus.latest(topics.TWIST)

    assert drive(None, 0.9) == Twist(height=0.9)
    assert drive(Twist(0.3)) == Twist(0.3, height=0.9)
    assert drive(None, 0.95) == Twist(0.3, height=0.95)  # a height does not stop who drives
    goal = client.send("/skill/stand", stand(0.2))
    assert drive(None, 0.8) == Twist() == drive(Twist())
    assert client.outcome(goal)[0] is GoalStatus.SUCCEEDED
    assert drive(Twist(0.3)) == Twist(0.3)


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
    hold(1.5)  # a reset waits for a second, and for rest
    assert live.ask("reset")[0]
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
    live.reset()
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
    assert status is GoalStatus.ABORTED and "restarted" in result.reason


@pytest.mark.parametrize(
    ("action", "goal", "reason"),
    [
        ("/skill/pick", Pick_Goal("screw", "tray", "middle"), "'middle'; valid: either, left, right"),
        ("/skill/pick", Pick_Goal("", "tray", "left"), "names the class"),
        ("/skill/pick", Pick_Goal(), "valid: either, left, right"),
        ("/skill/pick", Pick_Goal("screw", "tray", "left", np.ones(3)), "pairs of finite numbers"),
        ("/skill/walk", Walk_Goal(PoseStamped(convert.header(0.0, "base_link"))), "'hold', do not walk"),
        ("/skill/walk", Walk_Goal(PoseStamped(convert.header(0.0, "map"))), "'map'; valid: base_link, odom"),
    ],
)
def test_a_goal_without_sense_is_refused_with_the_reason(client: Client, action: str, goal: Any, reason: str) -> None:
    status, result = client.outcome(client.send(action, goal))
    assert (status, result.stage) == (GoalStatus.ABORTED, "refused") and reason in result.reason


def test_hands_obey_services_while_the_gate_is_open(client: Client) -> None:
    side = client.live.up and client.live.up.side
    assert side is not None

    def goal() -> HandGoal | None:
        return side.bus.latest(topics.hand_goal("left"))

    assert client.call("/left/gripper/set_position", SetGap_Request(0.03)).success and goal() == HandGoal(0.03)
    assert client.call("/left/gripper/set_force", SetForce_Request(5.0)).success and goal() == HandGoal(None, 5.0)
    assert "between 0 and 0.108 m" in client.call("/left/gripper/set_position", SetGap_Request(float("nan"))).message
    client.live.ask("stop")
    client.live.run(0.02)
    answer = client.call("/left/gripper/open", Trigger_Request())
    assert not answer.success and "gate is shut" in answer.message


MINE = '''
"""Skills of a user."""
import sys
from dataclasses import dataclass, field
import numpy as np
from golem.errors import ConfigError
from golem.skills.base import SkillResult


@dataclass(frozen=True)
class CountGoal:
    """How far to count.

    Attributes:
        to: the last number.
    """

    to: int
    by: float = 1.0

    def __post_init__(self):
        if self.to > 1000:
            raise ValueError("too far")


@dataclass
class Options:
    fails: str = ""


@dataclass
class Numbers:
    numbers: list[int] = field(default_factory=list)


class Count:
    """Count, and do what no skill should."""

    Goal = CountGoal

    def __init__(self, config: Options = Options()):
        self.fails = config.fails

    def timeout(self, goal):
        if self.fails == "timeout":
            raise KeyError("timeout")
        return 0.1

    async def run(self, context, goal):
        await context.tick()
        match self.fails:
            case "run":
                raise ZeroDivisionError("by zero")
            case "exit":
                sys.exit(3)
            case "text":
                context.say("count", None)
            case "half":
                context.say("count", "\\ud800", data=object())
            case "result":
                return SkillResult(True, "done", None, 5)
            case "value":
                return SkillResult(True, "done", None, "Counted.", value=np.zeros(3))
            case "nothing":
                return None
            case "hangs":
                await context.sleep(1e6)
            case "refuses":
                raise ConfigError("Nobody counts on Sundays.")
            case "calls":
                return await context.run("walk", goal)
        return SkillResult(True, "done", None, "Counted.", {}, Numbers(list(range(goal.to))))


class Asleep:
    """Is no coroutine."""

    Goal = CountGoal

    def timeout(self, goal):
        return 1.0

    def run(self, context, goal):
        return 3
'''


@pytest.fixture
def mine(live: Live, tmp_path: Any) -> Callable[[str], Client]:
    """Makes somebody on the domain of a robot whose stack has the skills `count`, which fails so, and `asleep`."""
    (tmp_path / "mine.py").write_text(MINE)

    def make(fails: str) -> Client:
        live.leave("up")
        count = Choice(f"{tmp_path / 'mine.py'}:Count", {"fails": fails})
        live.stack = replace(live.stack, skills={"count": count, "asleep": Choice(f"{tmp_path}/mine.py:Asleep")})
        live.start_up()
        live.activate()
        live.run(0.02)
        return Client(live, live.member("client")[1])

    return make


def run(client: Client, skill: str, goal: str) -> tuple[GoalStatus, Any]:
    """Have a goal pursued by /skill/run; return its status and the action's result."""
    future = client.send("/skill/run", RunSkill_Goal(skill, goal)).result()
    client.until(lambda: future.done)
    return future.result().status, future.result().result


def test_a_skill_of_ones_own_is_run_by_its_name_and_its_value_comes_back(mine: Callable[[str], Client]) -> None:
    status, answer = run(mine(""), "count", '{"to": 3}')
    assert (status, answer.result.reason) == (GoalStatus.SUCCEEDED, "Counted.")
    assert json.loads(answer.value) == {"numbers": [0, 1, 2]}


def test_the_skills_and_their_goals_are_on_a_latched_topic(mine: Callable[[str], Client]) -> None:
    client, row = mine(""), public.topic("/skill/list")
    listed = client.node.subscription(row.name, row.type, None, row.qos)
    client.until(lambda: listed.latest() is not None)
    message = listed.latest()
    assert message is not None
    specs = read_list(message)
    assert list(specs) == [*registry.names("skill"), "count", "asleep"]
    assert specs["count"].summary == "Count, and do what no skill should"
    last = {"type": "integer", "description": "the last number.", "maximum": 1000}
    assert specs["count"].goal["properties"]["to"] == last
    assert specs["walk"].goal == with_ranges(WalkGoal, schema_of(WalkGoal))


@pytest.mark.parametrize(
    ("skill", "goal", "words"),
    [
        ("cuont", "{}", "stand, take, walk. Did you mean 'count'?"),
        ("", "", "Unknown skill ''"),
        ("count", "", "'to' has no default"),
        ("count", '{"two": 1}', "Unknown goal field of count 'two'; valid: by, to. Did you mean 'to'?"),
        ("count", '{"to": "three"}', "'to' is an integer, not 'three'"),
        ("count", '{"to": 5000}', "its goal raised ValueError: too far"),
        ("count", '{"to": 1, "by": NaN}', "is a finite number"),
        ("count", '{"to": 1', "The goal is no JSON"),
        ("count", "[" * 60_000, "The goal is no JSON"),
        ("count", '"' + "x" * 10_000_000 + '"', "10000002 characters"),
        ("count", "[1]", "a JSON object of its fields"),
        ("walk", '{"x": 1}', "The legs, 'hold', do not walk; give the stack a lower_body that does"),
        ("walk", '{"x": 1, "timeout": -5}', "The timeout of a walk is a positive time"),
        ("stand", '{"seconds": -1}', "zero or more seconds, not -1"),
    ],
)
def test_a_goal_that_no_skill_can_pursue_is_refused_with_the_reason(
    mine: Callable[[str], Client], skill: str, goal: str, words: str
) -> None:
    status, answer = run(mine(""), skill, goal)
    assert (status, answer.result.stage) == (GoalStatus.ABORTED, "refused")
    assert words in answer.result.reason and len(answer.result.reason) < 300


@pytest.mark.parametrize(
    ("fails", "stage", "words"),
    [
        ("timeout", "fault", "Module skill: count failed: KeyError: 'timeout' (mine.py:"),
        ("run", "fault", "Module skill: count failed: ZeroDivisionError: by zero (mine.py:"),
        ("exit", "fault", "SystemExit: 3"),
        ("text", "fault", "TypeError: the text of the feedback is a str, not a NoneType"),
        ("result", "fault", "TypeError: the reason of a result is a str, not a int"),
        ("value", "fault", "The result failed: TypeError: Object of type ndarray is not JSON serializable"),
        ("nothing", "fault", "it returned NoneType, not SkillResult"),
        ("refuses", "refused", "Nobody counts on Sundays."),
        ("calls", "refused", "The skill 'walk' takes a WalkGoal, not a CountGoal."),
        ("hangs", "timeout", "Not done after 0.1 s of robot time."),
    ],
)
def test_whatever_a_skill_does_ends_its_goal_and_nothing_else(
    mine: Callable[[str], Client], fails: str, stage: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    client = mine(fails)
    status, answer = run(client, "count", '{"to": 3}')
    assert (status, answer.result.stage) == (GoalStatus.ABORTED, stage) and words in answer.result.reason
    assert ("Traceback" in capsys.readouterr().out) == (stage == "fault" and fails != "nothing")
    assert client.outcome(client.send("/skill/stand", stand(0.05)))[0] is GoalStatus.SUCCEEDED


def test_half_a_character_in_what_a_skill_says_is_replaced(mine: Callable[[str], Client]) -> None:
    client = mine("half")
    status, _ = run(client, "count", '{"to": 3}')
    assert status is GoalStatus.SUCCEEDED and client.said == ["?"]


def test_a_skill_that_is_no_coroutine_is_at_fault(mine: Callable[[str], Client]) -> None:
    status, answer = run(mine(""), "asleep", '{"to": 3}')
    assert (status, answer.result.stage) == (GoalStatus.ABORTED, "fault")
    assert "its 'run' is not an 'async def'" in answer.result.reason


def test_a_label_that_nobody_knows_is_refused_with_those_that_are_known(live: Live) -> None:
    live.leave("twin")
    live.leave("up")
    live.stack = live.stack.with_choice("localizer", "onnx").with_choice("robot", "mujoco")
    live.start_twin()
    live.start_up()
    live.run(0.2)
    live.ask("reset")
    live.activate()
    live.run(0.02)
    client = Client(live, live.member("client")[1])
    status, result = client.outcome(client.send("/skill/pick", Pick_Goal("banana", "tray", "right")), 4.0)
    assert (status, result.stage, result.slot) == (GoalStatus.ABORTED, "refused", "")
    known = "bottle, bowl, bus_bar, can, handle, mug, nut, screw, screw_hole, tray"
    assert result.reason == f"Unknown label 'banana'; valid: {known}."
