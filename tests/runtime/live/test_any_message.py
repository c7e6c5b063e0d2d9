"""Whatever anybody sends, each answer is an answer, and nothing ends the processes that balance the robot.

The tables are made of the message definitions: every field of every goal, request and command at its default, at its
extremes, not finite, empty and huge. Behind them come random ones; `GOLEM_FUZZ_MESSAGES=100000` sends so many.
"""

from __future__ import annotations

import copy
import json
import os
import random
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags")

from tests.middleware.ros.samples import mutated, random_message
from tests.middleware.wire import fuzz
from tests.runtime.live.conftest import Live

from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.interfaces.payloads import GateState
from golem.interfaces.public import TopicRow
from golem.middleware.dds.base import DdsError, Qos
from golem.middleware.ros import codec, names
from golem.middleware.ros.action_client import ClientGoal
from golem.middleware.ros.definitions import EMPTY_MEMBER
from golem.middleware.ros.future import Future
from golem.middleware.ros.goals import GoalStatus
from golem.middleware.ros.message import ARRAY, BASE, NAME, numpy_name, python_name
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
from golem.runtime.skill_table import SkillTable
from golem.stack import Stack
from golem.types import TICK

COUNT = int(os.environ.get("GOLEM_FUZZ_MESSAGES", "1000"))
BATCH = 25
"""Random messages between two looks at the answers."""
FLOATS = (0.0, -1.0, 1e9, 1e308, -1e308, 5e-324, float("nan"), float("inf"), float("-inf"))
TEXTS = ("", "\0", "odom", "ø" * 300, "x" * 10_000_000)
JSONS = ('""', "null", "true", "-1", "1e308", "1e999", "NaN", "[]", "{}", '[{"a": []}]', '"\\ud800"', "9" * 5000)
SOUND: dict[str, Any] = {
    "/skill/run": RunSkill_Goal("stand", '{"seconds": 0.02}'),
    "/skill/pick": Pick_Goal("screw", "tray", "right"),
    "/skill/walk": Walk_Goal(PoseStamped(convert.header(0.0, "base_link")), convert.duration(1.0)),
    "/skill/navigate": Walk_Goal(PoseStamped(convert.header(0.0, "base_link")), convert.duration(1.0)),
    "/skill/stand": Stand_Goal(convert.duration(0.02)),
    "/left/gripper/set_position": SetGap_Request(0.03),
    "/left/gripper/set_force": SetForce_Request(5.0),
}
"""Goals and requests that make sense; the others' defaults do."""
WALKS = ("/skill/walk", "/skill/navigate")
"""Actions of legs."""
STOPS = ("/safety/stop", "/estop/press")
"""Services after which it takes a while until the robot may move again."""
KNOWN = codec.codec()
SPECS = SkillTable(Stack()).specs
COMMANDS = [row for row in public.TOPICS if row.to and not row.vendor]
"""What GOLEM's processes read of the messages that the codec writes."""


def variants(message: Any) -> Iterator[Any]:
    """Yield copies of `message`, each with one field, at any depth, at an edge of what it can hold."""
    for field, kind in KNOWN._types[message.__msgtype__][1]:
        if field != EMPTY_MEMBER:
            for value in _edges(kind, getattr(message, python_name(field))):
                other = copy.deepcopy(message)
                setattr(other, python_name(field), value)
                yield other


def _edges(kind: tuple[int, Any], now: Any) -> Iterator[Any]:
    what, of = kind
    if what == NAME:
        yield from variants(now)
        return
    if what == BASE:
        yield from _scalars(of[0])
        return
    element, length = of
    if element[0] == NAME:
        yield from ([], *([each] for each in variants(KNOWN.message(element[1])())))
    elif element[1][0] == "string":
        yield from ([], *([text] for text in TEXTS))
    else:
        dtype = np.dtype(getattr(np, numpy_name(element[1][0])))
        for count in (length,) if what == ARRAY else (0, 1, 1000):
            for value in _scalars(element[1][0]):
                yield np.full(count, value, dtype)


def _scalars(kind: str) -> tuple[Any, ...]:
    if kind == "string":
        return TEXTS
    if kind == "bool":
        return False, True
    if kind in ("float32", "float64"):
        return FLOATS if kind == "float64" else (0.0, -1.0, 3e38, float("nan"), float("inf"))
    limits = np.iinfo(getattr(np, numpy_name(kind)))
    return 0, 1, int(limits.max), int(limits.min)


class Crowd:
    """Somebody who sends anything, in simulated time.

    Attributes:
        goals, calls: what has not been answered yet.
    """

    def __init__(self, live: Live) -> None:
        self.live = live
        self.participant, self.node = live.member("crowd")
        self.actions = {row.name: self.node.action_client(row.name, row.type) for row in public.ACTIONS}
        self.services = {row.name: self.node.client(row.name, row.type) for row in public.SERVICES}
        self.publishers = {row: self.node.publisher(row.name, row.type, row.qos) for row in COMMANDS}
        self.goals: list[Future[ClientGoal]] = []
        self.calls: list[Future[Any]] = []
        self.until(lambda: all(c.ready() for c in (*self.actions.values(), *self.services.values())))

    def until(self, condition: Callable[[], bool], seconds: float = 1.0) -> None:
        """Let time pass until `condition()`."""
        end = self.live.clock + seconds
        while not condition():
            assert self.live.clock < end, "no answer"
            self.live.run(TICK)
            self.node.poll()

    def pursue(self, action: str, goal: Any) -> tuple[GoalStatus, Any]:
        """Give a goal, cancel it if it does not end by itself soon, and return how it ended."""
        self.goals.append(self.actions[action].send_goal(goal))
        return self.settle()[0]

    def settle(self) -> list[tuple[GoalStatus, Any]]:
        """Wait for every answer, and return how the goals ended."""
        self.until(lambda: all(future.done for future in (*self.goals, *self.calls)))
        results = [future.result().result() for future in self.goals]
        end = self.live.clock + 0.06
        self.until(lambda: all(r.done for r in results) or self.live.clock > end)
        if not all(result.done for result in results):
            for client in self.actions.values():
                client.cancel()
        self.until(lambda: all(result.done for result in results))
        for call in self.calls:
            answer = call.result()
            assert getattr(answer, "success", True) or answer.message
        self.goals, self.calls = [], []
        ended = [(r.result().status, r.result().result.result) for r in results]
        assert all(status.terminal and result.stage and result.reason for status, result in ended)
        return ended

    def revive(self) -> None:
        """Have the robot move again, whatever was done to it."""
        for _ in range(60):  # a reset waits for a second, and for rest
            if self.live.state is GateState.ACTIVE:
                return
            self.live.run(0.05)
            for what in ("release", "reset", "activate"):
                self.live.ask(what)
        raise AssertionError(self.live.reason)


@pytest.fixture
def crowd(live: Live, capsys: pytest.CaptureFixture[str]) -> Iterator[Crowd]:
    """Somebody beside a robot that may move, who leaves it well, and nothing to be logged."""
    live.activate()
    live.run(0.02)
    crowd = Crowd(live)
    yield crowd
    live.run(0.1)
    crowd.revive()
    live.run(0.02)
    status, result = crowd.pursue("/skill/stand", SOUND["/skill/stand"])
    assert status is GoalStatus.SUCCEEDED, result
    said = capsys.readouterr()
    assert "Traceback" not in said.out + said.err


@pytest.mark.parametrize("action", [row.name for row in public.ACTIONS])
def test_every_field_of_every_goal_at_its_edges(crowd: Crowd, action: str) -> None:
    kind = codec.action(next(row.type for row in public.ACTIONS if row.name == action))
    stages = [crowd.pursue(action, goal)[1].stage for base in (kind.Goal(), SOUND[action]) for goal in variants(base)]
    assert len(stages) > 15 and "refused" in stages
    assert {"done", "cancelled", "detect"} & set(stages) or action in WALKS  # whose legs do not


@pytest.mark.slow
def test_every_field_of_every_goal_in_json_at_its_edges(crowd: Crowd) -> None:
    walk = {"x": 1.0}
    sound = {
        "calibrate": {"file": ""},
        "calibrate_hands": {"file": ""},
        "calibrate_lidar": {"file": "none.json"},
        "disassemble": {},
        "open": {},
        "pick": {},
        "walk": walk,
        "navigate": walk,
        "explore": {},
        "dock": {},
        "recall": {"text": "screw"},
        "remember": {"labels": ["screw"], "seconds": 0.02},
        "stand": {"seconds": 0.02},
        "fetch": {"text": "can"},
        "take": {"label": "can"},
        "place": {"x": 0.5, "y": 0.0},
        "policy": {"seconds": 0.02},
        "search": {"text": "can", "places": 0},
    }
    for spec in SPECS.values():
        for field in spec.goal["properties"]:
            others = json.dumps({k: v for k, v in sound[spec.name].items() if k != field})[1:-1]
            for value in JSONS:
                text = f'{{{others}{", " if others else ""}"{field}": {value}}}'
                status, result = crowd.pursue("/skill/run", RunSkill_Goal(spec.name, text))
                assert status is not GoalStatus.SUCCEEDED or spec.name in ("stand", "recall", "policy"), (text, result)


@pytest.mark.parametrize("name", [row.name for row in public.SERVICES if not row.name.startswith("/right")])
def test_every_field_of_every_request_at_its_edges(crowd: Crowd, name: str) -> None:
    kind = codec.service(next(row.type for row in public.SERVICES if row.name == name))
    base = SOUND.get(name, kind.Request())
    for request in (kind.Request(), base, *variants(base)):
        crowd.calls.append(crowd.services[name].call(request))
        crowd.settle()


def test_every_field_of_every_command_at_its_edges(crowd: Crowd) -> None:
    waiting: dict[TopicRow, Iterator[Any]] = {
        row: variants(codec.message(row.type)()) for row in COMMANDS if row.name != "/safety/status"
    }
    while waiting:
        for row, messages in list(waiting.items()):
            message = next(messages, None)
            if message is None:
                del waiting[row]
            else:
                crowd.publishers[row].publish(message)
        if not crowd.goals:  # a skill that looks: images are read for it alone
            crowd.goals.append(crowd.actions["/skill/pick"].send_goal(SOUND["/skill/pick"]))
        crowd.live.run(TICK)
        crowd.node.poll()
        if crowd.goals[0].done and crowd.goals[0].result().status.terminal:
            crowd.goals.clear()
    crowd.settle()


def test_every_field_of_the_gates_status_at_its_edges(crowd: Crowd) -> None:
    row = public.topic("/safety/status")
    for message in variants(codec.message(row.type)()):
        crowd.publishers[row].publish(message)
        crowd.live.run(TICK)


def _send(crowd: Crowd, rng: random.Random) -> None:
    """Send one random thing."""
    match rng.randrange(5):
        case 0:
            row = rng.choice(public.ACTIONS)
            goal = random_message(KNOWN, f"{row.type}_Goal", rng)
            crowd.goals.append(crowd.actions[row.name].send_goal(rng.choice((goal, SOUND[row.name]))))
        case 1:
            spec = rng.choice(list(SPECS.values()))
            fields = rng.choices(sorted(spec.goal["properties"]), k=rng.randrange(3))
            text = ", ".join(f'"{field}": {rng.choice(JSONS)}' for field in (*fields, rng.choice(("x", "seconds"))))
            goal = RunSkill_Goal(rng.choice((spec.name, "", "pik")), f"{{{text}}}"[: rng.choice((None, -1))])
            crowd.goals.append(crowd.actions["/skill/run"].send_goal(goal))
        case 2:
            row = rng.choice([row for row in public.SERVICES if row.name not in STOPS])
            crowd.calls.append(crowd.services[row.name].call(random_message(KNOWN, f"{row.type}_Request", rng)))
        case 3:
            row = rng.choice(COMMANDS)
            crowd.publishers[row].publish(random_message(KNOWN, row.type, rng))
        case _:
            _send_damaged(crowd, rng)


def _send_damaged(crowd: Crowd, rng: random.Random) -> None:
    """Write a payload that somebody has tampered with."""
    row = rng.choice((*COMMANDS, *public.SERVICES, *public.ACTIONS))
    if row in public.SERVICES:
        topic, kind = names.request(row.name), f"{row.type}_Request"
    elif row in public.ACTIONS:
        topic, kind = names.request(names.action(row.name).send_goal), f"{row.type}_SendGoal_Request"
    else:
        topic, kind = names.topic(row.name), row.type
    payload = KNOWN.serialize(random_message(KNOWN, kind, rng))
    if topic.startswith("rq/"):
        payload = payload[:4] + rng.randbytes(16) + payload[4:]
    writer = crowd.participant.writer(topic, codec.dds_name(kind), Qos(depth=1000))
    with suppress(DdsError):  # no payload at all
        writer.write(mutated(payload, rng))
    writer.close()


@pytest.mark.timeout(120 + COUNT // 20)
@pytest.mark.slow
def test_thousands_of_random_goals_requests_and_commands(crowd: Crowd) -> None:
    rng = random.Random(COUNT)
    statuses: list[GoalStatus] = []
    for _ in range(COUNT // BATCH):
        for _ in range(BATCH):
            _send(crowd, rng)
        if rng.random() < 0.2:
            crowd.calls.append(crowd.services["/safety/stop"].call(Trigger_Request()))
        statuses += [status for status, _ in crowd.settle()]
        crowd.revive()
    assert set(statuses) >= {GoalStatus.SUCCEEDED, GoalStatus.ABORTED}


@pytest.mark.timeout(120 + COUNT // 20)
def test_thousands_of_random_frames_of_the_vendors(live: Live) -> None:
    targets = fuzz.targets()
    row = {"/lowstate": "LowState_", "/lowcmd": "LowCmd_", "/safety/lowcmd_in": "LowCmd_", "/onboard/lowcmd": "LowCmd_"}
    row |= {each.name: "Request_" for each in public.TOPICS if each.name.endswith("/request")}
    row |= {each.name: "Response_" for each in public.TOPICS if each.name.endswith("/response")}
    live.activate()
    participant, _ = live.member("stranger")
    writers = {
        name: participant.writer(names.topic(name), codec.dds_name(public.topic(name).type), Qos(depth=1000))
        for name in row
    }
    streams = {name: fuzz.payloads(targets[kind], COUNT, seed) for seed, (name, kind) in enumerate(row.items())}
    for _ in range(COUNT // BATCH):
        for name, payloads in streams.items():
            for _ in range(1 + BATCH // len(streams)):
                with suppress(DdsError):
                    writers[name].write(next(payloads))
        live.run(TICK)
    assert live.state.stopped
    participant.close()
    live.reset()
    live.activate()
