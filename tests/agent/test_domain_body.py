"""The desk beside twin, gate and stack on a domain, as a client of their topics and actions."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.runtime.live.conftest import Live, live  # noqa: F401 - a fixture

from golem.agent.audit import AuditLog
from golem.agent.desk import Answer, Call, Desk
from golem.agent.domain_body import DomainBody
from golem.agent.tool_rules import Rules
from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.middleware.dds.local import LocalDomain, LocalParticipant
from golem.middleware.ros import codec, names
from golem.middleware.ros.msgs.nav_msgs import MapMetaData, OccupancyGrid
from golem.middleware.ros.node import RosNode
from golem.middleware.wire.convert import encode_low_state
from golem.middleware.wire.hg import LOW_STATE
from golem.runtime.live.skill_messages import list_message
from golem.types import TICK, Imu, LowState, PlanarPose


@pytest.fixture
def desk(live: Live, tmp_path: Path) -> Desk:  # noqa: F811
    live.activate()
    live.run(0.1)
    body = DomainBody(*live.member("mcp"), "start one")
    spin = body.step

    def step() -> None:
        live.run(5 * TICK)
        spin()

    body.step = step
    return Desk(body, Rules(default="free", calls=1000), AuditLog(tmp_path / "audit.jsonl"))


def finish(desk: Desk, call: Call, until: Callable[[], bool] = lambda: False) -> Answer | None:
    desk.submit(call)
    for _ in range(2000):
        desk.turn()
        if call.answered.done() or until():
            break
    return call.answered.result(0) if call.answered.done() else None


def test_skills_of_the_domain_are_tools(desk: Desk) -> None:
    assert desk.body.specs["open"].result["properties"] and "walk" in desk.body.specs
    said: list[str] = []
    done = finish(desk, Call("a", "stand", {"seconds": 0.3}, lambda f: said.append(f.text)))
    assert done is not None and done.data["success"], done
    assert done.data["timings"] == {"stand": pytest.approx(0.3, abs=0.02)} and said
    recalled = desk.call("recall", {"text": "mug"})
    assert recalled["success"], recalled
    assert recalled["value"]["places"] == []
    assert desk.call("read", {"resource": "safety"})["safety"]["state"] == "active"
    state = desk.call("read", {"resource": "state"})["state"]
    assert len(state["joints"]) == 27 and state["base"]["frame"] == "odom"


def test_what_the_stack_refuses_is_said(desk: Desk) -> None:
    data = desk.call("walk", {"x": 1.0})
    assert not data["success"] and data["stage"] == "refused" and "do not walk" in data["reason"]["text"]


def test_a_cancellation_reaches_the_robot(desk: Desk) -> None:
    call = Call("a", "stand", {"seconds": 100.0})
    heard: list[str] = []
    call.tell = lambda feedback: heard.append(feedback.text)
    assert finish(desk, call, lambda: bool(heard)) is None
    desk.cancel(call)
    for _ in range(100):
        desk.turn()
        if call.answered.done():
            break
    assert call.answered.result(0).data["stage"] == "cancelled" and not desk.body.busy


def test_a_stop_of_the_motors_is_the_gates(desk: Desk, live: Live) -> None:  # noqa: F811
    assert desk.call("stop", {"motors": True})["success"]
    live.run(0.2)
    assert live.state is not None and live.state.value.startswith("stop")


@pytest.fixture
def silent() -> tuple[LocalParticipant, RosNode, DomainBody]:
    """A stack without skills, of which a test says what it says, and the body of a client of its."""
    domain = LocalDomain()
    participant, row = domain.participant(), public.topic("/skill/list")
    robot = RosNode(participant, "robot")
    robot.publisher(row.name, row.type, row.qos).publish(list_message(()))
    client = domain.participant()
    return participant, robot, DomainBody(client, RosNode(client, "mcp", log=lambda line: None), "start one")


def test_a_place_in_the_map_is_known_in_odom(silent: tuple[LocalParticipant, RosNode, DomainBody]) -> None:
    """The rules' region refused every goal in the map, since nobody listened to where that is."""
    _, robot, body = silent
    assert body.in_odom("map", 1.0, 0.0) is None
    row = public.topic("/tf", "stack")
    told = robot.publisher(row.name, row.type, row.qos)
    place = PlanarPose(2.0, 1.0, math.pi / 2).matrix()
    told.publish(convert.transforms(0.5, [("odom", "base_link"), ("map", "odom")], np.array([np.eye(4), place])))
    told.publish(convert.transforms(0.5, [("odom", "base_link")], np.eye(4)[np.newaxis]))
    body.step()
    assert body.in_odom("map", 2.0, 3.0) == pytest.approx((2.0, 0.0))
    assert body.in_odom("odom", 2.0, 3.0) == (2.0, 3.0)


def test_what_cannot_be_read_is_left_out(silent: tuple[LocalParticipant, RosNode, DomainBody]) -> None:
    """One damaged frame ended the process, and the skill that ran went on without its rules."""
    participant, robot, body = silent
    row = public.topic("/map")
    robot.publisher(row.name, row.type, row.qos).publish(OccupancyGrid(info=MapMetaData(width=3, height=3)))
    row = public.topic("/lowstate")
    states = participant.writer(names.topic(row.name), codec.dds_name(row.type), row.qos)
    states.write(LOW_STATE.blank())
    body.step()
    assert body.t == 0.0 and body.read("map")["map"] is None
    q = np.zeros(27)
    states.write(
        encode_low_state(LowState(1.5, q, q, q, Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))))
    )
    body.step()
    assert body.t == 1.5
