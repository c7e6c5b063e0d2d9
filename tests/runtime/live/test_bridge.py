"""A new stream is a row, a converter, and the code that makes its values: DDS, bags, replay and the docs follow."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from scripts.topics_page import page
from tests.runtime.live.conftest import Live

from golem.interfaces import public
from golem.interfaces.ros_convert import header, seconds
from golem.interfaces.rows import TopicRow
from golem.middleware.bags.reader import Bag
from golem.middleware.bus import Bus, Topic
from golem.middleware.dds.base import SENSOR
from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.msgs.sensor_msgs import Imu as ImuMessage
from golem.middleware.ros.node import RosNode
from golem.runtime.executor import Phase
from golem.runtime.live.bridge import StreamIn, StreamOut, outgoing
from golem.runtime.live.broadcast import broadcast
from golem.runtime.live.node_setup import until
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.runtime.lockstep import build
from golem.runtime.node_groups import RobotNodes
from golem.stack import load_stack
from golem.types import SIDES, TICK


@dataclass(frozen=True)
class Shake:
    """How hard the head shakes [m/s^2] at `t` [s]."""

    t: float
    size: float


SHAKE = Topic("shake", Shake)


def encode(shake: Shake) -> ImuMessage:
    message = ImuMessage(header(shake.t, "camera_link"))
    message.linear_acceleration.z = shake.size
    return message


def decode(message: ImuMessage) -> Shake:
    if message.linear_acceleration.z < 0.0:
        raise CodecError("A shake has no sign.")
    return Shake(seconds(message.header.stamp), message.linear_acceleration.z)


ROW = TopicRow(
    "/head/shake", "sensor_msgs/msg/Imu", "robot", ("stack",), SENSOR, 100, "camera_link", "How hard the head shakes.",
    SHAKE, encode, decode, on_demand=True, thinned=True,
)  # fmt: skip


@pytest.fixture
def row(monkeypatch: pytest.MonkeyPatch) -> TopicRow:
    """The made-up stream, in the table."""
    monkeypatch.setattr(public, "TOPICS", (*public.TOPICS, ROW))
    return ROW


class ShakeNode:
    """The code that makes the data: a node of the robot."""

    period = TICK

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    def step(self, t: float) -> None:
        self._bus.publish(SHAKE, Shake(t, 3.0), t)


@pytest.fixture
def shaking(row: TopicRow, monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot with such a node."""
    make = RobotNodes.__init__

    def init(nodes: RobotNodes, bus: Bus, *args: Any) -> None:
        make(nodes, bus, *args)
        nodes.nodes.append((Phase.MEASURE, ShakeNode(bus)))

    monkeypatch.setattr(RobotNodes, "__init__", init)


def ends(domain: LocalDomain) -> tuple[RoleEndpoints, RoleEndpoints]:
    """Return the endpoints of a robot and of a stack."""
    robot, stack = domain.participant(), domain.participant()
    return RoleEndpoints("robot", robot, RosNode(robot, "robot")), RoleEndpoints(
        "stack", stack, RosNode(stack, "stack")
    )


def test_a_twin_offers_it_and_a_stack_reads_it(shaking: None, live: Live) -> None:
    live.run(0.1)
    assert live.up is not None and live.up.side is not None
    bus = live.up.side.bus
    assert bus.count(SHAKE) == 10
    shake = bus.latest(SHAKE)
    assert shake is not None and (shake.t, shake.size) == (pytest.approx(0.09), 3.0)


def test_it_crosses_dds(row: TopicRow, domain: int) -> None:
    pytest.importorskip("cyclonedds")
    robot, stack = connect(DdsConfig(domain)), connect(DdsConfig(domain))
    bus, there = Bus(), Bus()
    try:
        node = RosNode(stack, "stack")
        sender = RoleEndpoints("robot", robot, RosNode(robot, "robot"), only=[row.name])
        listener = RoleEndpoints("stack", stack, node, only=())
        StreamIn(there, listener, row, lambda: 0.0)
        assert until(node, lambda: sender.heard(row.name), 10.0)
        ((_, out),) = outgoing(bus, sender)
        bus.publish(SHAKE, Shake(1.5, 3.0), 1.5)
        out.step(1.5)
        assert until(node, lambda: there.latest(SHAKE) is not None, 10.0)
        assert there.latest(SHAKE) == Shake(1.5, 3.0)
    finally:
        robot.close()
        stack.close()


def test_it_is_in_a_bag_at_its_rate_and_is_read_back(
    row: TopicRow, shaking: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("mcap")
    running, robot = build(load_stack("tether"), seed=0)
    with broadcast(running, robot, bag=tmp_path / "bag") as show:
        running.executor.run(0.2, lambda: show() is not None)
    robot.close()
    assert re.search(r"^\d+ messages, \d\.\d MB, in .*bag\.$", capsys.readouterr().out, re.M)
    values = [row.value(message.payload) for message in Bag(tmp_path / "bag").messages([row.name])]
    assert [value.t for value in values] == [pytest.approx(0.01 * k) for k in range(20)]
    assert {value.size for value in values} == {3.0}


def test_it_is_in_the_documentation(row: TopicRow) -> None:
    text = page()
    assert "| `/head/shake` | " in text and "| `sensor_msgs/msg/Imu` | best effort, keep 5 | 100" in text


def test_nothing_is_made_that_nobody_wants(row: TopicRow) -> None:
    robot, stack = ends(LocalDomain())
    made: list[Shake] = []
    robot.send(row.name, Shake(0.0, 1.0), made.append)
    StreamIn(Bus(), stack, row, lambda: 0.0)
    robot.send(row.name, Shake(0.1, 1.0), made.append)
    assert made == [Shake(0.1, 1.0)]


def test_each_value_is_sent_once(row: TopicRow) -> None:
    robot, stack = ends(LocalDomain())
    bus, there = Bus(), Bus()
    StreamIn(there, stack, row, lambda: 0.0)
    out = StreamOut(bus, robot, row)
    bus.publish(SHAKE, Shake(0.0, 1.0), 0.0)
    for _ in range(3):
        out.step(0.0)
        stack.step(0.0)
    assert there.count(SHAKE) == 1


def test_a_message_that_is_no_value_is_refused_by_name(row: TopicRow) -> None:
    robot, stack = ends(LocalDomain())
    said: list[str] = []
    there = Bus()
    incoming = StreamIn(there, stack, row, lambda: 0.0, said.append)
    robot.send(row.name, Shake(0.0, -1.0))
    stack.step(0.0)
    assert there.latest(SHAKE) is None and incoming.refused.count == 1
    assert said == ["1 messages on /head/shake refused so far, the last one because: A shake has no sign."]


def test_every_row_of_a_stream_can_be_sent() -> None:
    """Or its process says how: it is the few whose message takes more than the value."""
    special = {row.name for row in public.TOPICS if row.key is not None and row.encode is None}
    hands = {f"/{what}/{side}" for what in ("wrench", "contact") for side in SIDES}
    asked = {"/arm_sdk", "/wirelesscontroller"}
    assert special == {"/lowcmd", "/joint_states", "/tf", "/odom", "/safety/lowcmd_in"} | hands | asked
    assert all(row.rate for row in public.TOPICS if row.thinned)
