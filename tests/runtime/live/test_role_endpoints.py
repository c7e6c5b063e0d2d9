"""What running processes offer and read is what the table says: nothing more, nothing less."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.runtime.live.conftest import BLIND, Live

from golem.interfaces import public, topics
from golem.interfaces.payloads import DetectionRequest
from golem.interfaces.public import Role
from golem.middleware.dds.base import Qos
from golem.middleware.dds.local import LocalDomain, LocalParticipant
from golem.middleware.ros import names
from golem.middleware.ros.codec import action, dds_name, service
from golem.middleware.ros.node import SERVICES
from golem.runtime.live.stack_process import SHOWN
from golem.stack import Choice, Stack
from golem.types import TICK

PATIENT = Qos(reliable=False, depth=1000)
"""Takes whatever is offered, and loses nothing of a second."""
Ends = set[tuple[str, str, str]]
"""Way (`w` or `r`), topic and type on the wire."""


class Spy(LocalParticipant):
    """Remembers what its member creates."""

    def __init__(self, domain: LocalDomain) -> None:
        super().__init__(domain)
        self.seen: Ends = set()
        self.offered: dict[str, Qos] = {}
        self.requested: dict[str, Qos] = {}

    def writer(self, topic: str, type_name: str, qos: Qos, user_data: str = "") -> Any:
        self.seen.add(("w", topic, type_name))
        self.offered[topic] = qos
        return super().writer(topic, type_name, qos, user_data)

    def reader(self, topic: str, type_name: str, qos: Qos, user_data: str = "", on_data: Any = None) -> Any:
        self.seen.add(("r", topic, type_name))
        self.requested[topic] = qos
        return super().reader(topic, type_name, qos, user_data, on_data)


class SpyDomain(LocalDomain):
    """Whose members are spied on."""

    def participant(self) -> Spy:
        return Spy(self)


def of_service(name: str, kind: Any, served: bool) -> Ends:
    """Return the two endpoints of a server, or of a client."""
    ways = "rw" if served else "wr"
    return {
        (ways[0], names.request(name), dds_name(kind.Request)),
        (ways[1], names.reply(name), dds_name(kind.Response)),
    }


def own(node: str) -> Ends:
    """Return the endpoints of ROS's own that every node has: discovery, and the services of parameters."""
    ends: Ends = {("w", names.DISCOVERY_INFO, "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_")}
    for name, (kind, _) in SERVICES.items():
        ends |= of_service(f"/{node}/{name}", service(f"rcl_interfaces/srv/{kind}"), served=True)
    return ends


def of_role(role: Role) -> Ends:
    """Return every endpoint that the table gives a role, but for ROS's own."""
    ends: Ends = set()
    for row in public.TOPICS:
        if row.by == role:
            ends.add(("w", names.topic(row.name), dds_name(row.type)))
        if role in row.to:
            ends.add(("r", names.topic(row.name), dds_name(row.type)))
    for row in public.SERVICES:
        if row.by == role:
            ends |= of_service(row.name, service(row.type), served=True)
    for row in public.ACTIONS:
        if row.by != role:
            continue
        parts, kinds = names.action(row.name), action(row.type)
        ends |= of_service(parts.send_goal, kinds.SendGoal, served=True)
        ends |= of_service(parts.get_result, kinds.GetResult, served=True)
        ends |= of_service(parts.cancel_goal, service("action_msgs/srv/CancelGoal"), served=True)
        ends.add(("w", names.topic(parts.feedback), dds_name(kinds.FeedbackMessage)))
        ends.add(("w", names.topic(parts.status), dds_name("action_msgs/msg/GoalStatusArray")))
    return ends


@pytest.mark.parametrize(("support", "vendor", "unread"), [("hoist", "h1", "sport"), ("ground", "g1", "loco")])
def test_processes_offer_what_the_table_says(support: str, vendor: str, unread: str, tmp_path: Path) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    robot = Choice("mujoco", {"world": "open", "support": support})
    choices = {
        "robot": robot,
        "lower_body": Choice("vendor", {"robot": vendor}),
        "localizer": Choice(f"{tmp_path / 'blind.py'}:Blind"),
        "odometry": Choice("lio"),  # clouds are read only where the odometry goes by them
        "fallback": Choice("hold", {"standing": support == "ground"}),
        "onboard": Choice("hold", {"standing": support == "ground"}),
    }
    stack = Stack(choices, profile="ideal")
    live = Live(stack, SpyDomain())
    live.start_twin()
    live.start_gate()
    live.start_up()
    live.run(0.01)
    assert live.up is not None and live.up.side is not None
    for camera in public.CAMERAS:  # images are read only while a skill looks
        live.up.side.bus.publish(topics.detection_request(camera), DetectionRequest(("screw",)), 0.01)
    live.run(0.01)
    seen = {node.name: member.seen for member, node in live.members if isinstance(member, Spy)}
    gantry = of_service("/elastic_band/release", service(public.TRIGGER), served=False)
    live.close()
    calls = ("r", f"rt/api/{unread}/request", dds_name("unitree_api/msg/Request"))
    answers = ("r", f"rt/api/{unread}/response", dds_name("unitree_api/msg/Response"))
    assert seen["twin"] - own("twin") == of_role("robot") - {calls}
    assert seen["safety"] - own("safety") == of_role("safety")
    assert seen["up"] - own("up") == of_role("stack") - {answers} | (gantry if support == "ground" else set())


SILENT = ("/onboard/",)
"""Begin of topics whose publishers are silent here: legs that nobody switched on."""


@pytest.fixture(scope="module")
def standing(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Live, dict[str, list[Any]]]]:
    """A robot on its feet, and what somebody hears of it in a second: every topic but images."""
    folder = tmp_path_factory.mktemp("surface")
    (folder / "blind.py").write_text(BLIND)
    robot = Choice("mujoco", {"world": "open", "support": "ground"})
    eyes = Choice(f"{folder / 'blind.py'}:Blind")
    legs = Choice("hold", {"standing": True})
    choices = {"robot": robot, "localizer": eyes, "lower_body": legs, "fallback": legs}
    live = Live(Stack(choices, profile="ideal"), SpyDomain())
    live.start_twin()
    live.start_gate()
    live.start_up()
    listener, node = live.member("listener")
    heard: dict[str, list[Any]] = {}
    readers = {}
    for row in public.TOPICS:
        if row.by == "user" or row.name.startswith("/realsense/") or row.name in heard:
            continue
        if row.vendor:
            readers[row.name] = listener.reader(names.topic(row.name), dds_name(row.type), PATIENT)
        else:
            node.subscription(row.name, row.type, heard.setdefault(row.name, []).append, PATIENT)
    live.activate()
    live.run(0.5)
    node.poll()
    for messages in heard.values():
        messages.clear()
    for reader in readers.values():
        reader.take(1 << 16)
    for _ in range(500):
        live.run(TICK)
        node.poll()
    heard |= {name: reader.take(1 << 16) for name, reader in readers.items()}
    yield live, heard
    live.close()


def test_topics_come_at_the_rate_and_in_the_frame_that_the_table_says(
    standing: tuple[Live, dict[str, list[Any]]],
) -> None:
    rows = [row for row in public.TOPICS if row.rate is not None and row.name in standing[1]]
    assert len(rows) > 10
    for row in rows:
        messages = standing[1][row.name]
        if row.name.startswith(SILENT):
            assert not messages
            continue
        rate = sum(other.rate or 0.0 for other in rows if other.name == row.name)  # of /tf there are two
        assert len(messages) == pytest.approx(rate, rel=0.03, abs=1), row.name
        if hasattr(messages[-1], "header"):
            assert messages[-1].header.frame_id == row.frame, row.name


def test_endpoints_have_the_qos_that_the_table_says(standing: tuple[Live, dict[str, list[Any]]]) -> None:
    members = {node.name: member for member, node in standing[0].members if isinstance(member, Spy)}
    roles: dict[str, Role] = {"twin": "robot", "safety": "safety", "up": "stack"}
    for process, role in roles.items():
        member = members[process]
        for row in public.TOPICS:
            topic = names.topic(row.name)
            if row.by == role:
                assert member.offered[topic] == row.qos, row.name
            if role in row.to and topic in member.requested:  # images are read while a skill looks
                asked = member.requested[topic]
                assert not asked.reliable or row.qos.reliable, row.name
                assert asked.transient_local == row.qos.transient_local, row.name
    assert not members["up"].requested["rt/cmd_vel"].reliable  # a joystick may offer no more


def test_beside_the_real_robot_the_stack_shows_what_follows_from_its_state(tmp_path: Path) -> None:
    (tmp_path / "blind.py").write_text(BLIND)
    robot = Choice("mujoco", {"world": "open", "support": "ground"})
    eyes = Choice(f"{tmp_path / 'blind.py'}:Blind")
    legs = Choice("hold", {"standing": True})
    choices = {"robot": robot, "localizer": eyes, "lower_body": legs, "fallback": legs}
    live = Live(Stack(choices, profile="ideal"), SpyDomain())
    live.start_twin()  # stands for the robot
    live.start_up(real=True)
    _, listener = live.member("listener")
    joints, links = (
        listener.subscription(row.name, row.type, None, row.qos)
        for row in (public.topic("/joint_states"), public.topic("/tf_static"))
    )
    live.run(0.05)
    member = next(member for member, node in live.members if node.name == "up")
    assert isinstance(member, Spy)
    shown = {end for end in of_role("robot") if end[0] == "w" and end[1][2:] in SHOWN}
    gantry = of_service("/elastic_band/release", service(public.TRIGGER), served=False)
    assert len(shown) == len(SHOWN) and shown <= member.seen and not gantry & member.seen
    state, tree = joints.latest(), links.latest()
    assert state is not None and len(state.name) == 35
    assert tree is not None
    frames = {link.child_frame_id for link in tree.transforms}
    assert {"pelvis", "imu_link", "lidar_link", "left_gripper"} <= frames
    live.close()
