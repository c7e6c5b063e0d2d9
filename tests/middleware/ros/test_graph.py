"""What ROS learns of our nodes: the announcements on `ros_discovery_info`, and USER_DATA of every endpoint."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

pytest.importorskip("rosbags")

from rosbags.typesys import Stores, get_typestore

from golem.errors import ConfigError
from golem.middleware.dds.base import LATCHED, Participant, Sample
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.codec import dds_name, type_hash
from golem.middleware.ros.node import SERVICES, RosNode
from golem.middleware.ros.node_endpoints import INFO, PARTICIPANT_USER_DATA

from .conftest import PICK, SET_BOOL, STRING


class Handler:
    def decide(self, request: Any) -> bool:
        return False

    def accepted(self, goal: Any) -> None: ...

    def cancel(self, goal: Any) -> bool:
        return False


def newest(observer: Participant) -> list[Sample]:
    return observer.reader("ros_discovery_info", dds_name(INFO), LATCHED).take()


def gid(guid: bytes, size: int) -> list[int]:
    return list(guid.ljust(size, b"\0"))


@pytest.mark.parametrize(
    ("distro", "store", "size"), [("humble", Stores.ROS2_HUMBLE, 24), ("jazzy", Stores.ROS2_JAZZY, 16)]
)
def test_a_node_is_announced_in_the_layout_of_its_peers(distro: str, store: Stores, size: int) -> None:
    domain = LocalDomain()
    participant = domain.participant()
    node = RosNode(participant, "twin", "/robot", distro)
    publisher = node.publisher("chatter", STRING)
    subscription = node.subscription("chatter", STRING)
    (sample,) = newest(domain.participant())
    types = get_typestore(store)
    info: Any = types.deserialize_cdr(sample.payload, INFO)
    assert list(info.gid.data) == gid(participant.guid, size)
    (entry,) = info.node_entities_info_seq
    assert (entry.node_namespace, entry.node_name) == ("/robot", "twin")
    assert list(entry.writer_gid_seq[-1].data) == gid(publisher.writer.guid, size)
    assert list(entry.reader_gid_seq[-1].data) == gid(subscription.inbox.guid, size)
    assert len(entry.writer_gid_seq) == len(entry.reader_gid_seq) == 1 + len(SERVICES)
    assert bytes(types.serialize_cdr(info, INFO)) == bytes(sample.payload)[: len(types.serialize_cdr(info, INFO))]


def test_what_is_closed_is_announced_no_more() -> None:
    domain = LocalDomain()
    node = RosNode(domain.participant(), "twin")
    node.client("set", SET_BOOL).close()
    node.action_client("pick", PICK).close()
    server = node.action_server("pick", PICK, Handler())
    types = get_typestore(Stores.ROS2_JAZZY)

    def endpoints() -> tuple[int, int]:
        (sample,) = newest(domain.participant())
        info: Any = types.deserialize_cdr(sample.payload, INFO)
        (entry,) = info.node_entities_info_seq
        return len(entry.reader_gid_seq), len(entry.writer_gid_seq)

    own = len(SERVICES)
    assert endpoints() == (own + 3, own + 5)
    server.close()
    assert endpoints() == (own, own)
    listener = domain.participant().reader("ros_discovery_info", dds_name(INFO), replace(LATCHED, depth=10))
    listener.take()
    node.close()
    last: Any = types.deserialize_cdr(listener.take()[0].payload, INFO)
    assert last.node_entities_info_seq == []


def test_an_unknown_distro_is_refused() -> None:
    with pytest.raises(ConfigError, match="'noetic'.*humble, jazzy"):
        RosNode(LocalDomain().participant(), "twin", distro="noetic")


def test_peers_are_told_hashes_and_identities(domain: int) -> None:
    pytest.importorskip("cyclonedds")
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant = connect(DdsConfig(domain=domain), PARTICIPANT_USER_DATA)
    node = RosNode(participant, "twin")
    node.publisher("chatter", STRING)
    node.service("set", SET_BOOL, lambda request: request)
    node.client("set", SET_BOOL)
    told = user_data(domain)
    node.close()
    participant.close()
    assert told["rt/chatter", "writer"] == {"typehash": type_hash(STRING)}
    for part, topic in (("Request", "rq/setRequest"), ("Response", "rr/setReply")):
        assert {told[topic, "writer"]["typehash"], told[topic, "reader"]["typehash"]} == {
            type_hash(f"{SET_BOOL}_{part}")
        }
    client, server = told["rq/setRequest", "writer"], told["rq/setRequest", "reader"]
    assert client["clientid"] == told["rr/setReply", "reader"]["clientid"]
    assert server["serviceid"] == told["rr/setReply", "writer"]["serviceid"]
    assert client["clientid"] != server["serviceid"]


def user_data(domain: int) -> dict[tuple[str, str], dict[str, str]]:
    """Return the USER_DATA of every endpoint on a domain, as keys and values, by topic and kind."""
    from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
    from cyclonedds.domain import DomainParticipant
    from cyclonedds.qos import Policy

    observer = DomainParticipant(domain)
    found: dict[tuple[str, str], dict[str, str]] = {}
    for kind, topic in (("writer", BuiltinTopicDcpsPublication), ("reader", BuiltinTopicDcpsSubscription)):
        for sample in BuiltinDataReader(observer, topic).take(1000):
            policy = sample.qos[Policy.Userdata]
            pairs = bytes(policy.data).decode().split(";")[:-1] if policy else ()
            found[sample.topic_name, kind] = dict(pair.split("=", 1) for pair in pairs)
    return found
