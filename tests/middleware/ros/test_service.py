"""The wire format of services, and what peers are told about them."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rosbags")

from hypothesis import given
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from golem.middleware.dds.base import ENCAPSULATION, Qos
from golem.middleware.ros.codec import dds_name, serialize, service
from golem.middleware.ros.message import CodecError, Header, pack, unpack
from golem.middleware.ros.node import RosNode

from .conftest import SET_BOOL, World

SetBool = service(SET_BOOL)


def test_the_header_is_a_struct_before_the_body_in_one_cdr_stream() -> None:
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg("uint64 guid\nint64 seq\nbool success\nstring message", "a/msg/Reply"))
    whole = store.types["a/msg/Reply"](2**64 - 1, 7, True, "yes")
    expected = bytes(store.serialize_cdr(whole, "a/msg/Reply"))
    payload = pack(Header(2**64 - 1, 7), serialize(SetBool.Response(True, "yes")))
    assert payload[: len(expected)] == expected
    assert len(payload) - len(expected) < 4


@given(st.integers(0, 2**64 - 1), st.integers(-(2**63), 2**63 - 1), st.binary())
def test_unpacking_undoes_packing(client: int, sequence: int, body: bytes) -> None:
    header = Header(client, sequence)
    assert unpack(pack(header, ENCAPSULATION + body)) == (header, ENCAPSULATION + body)
    assert unpack(memoryview(pack(header, ENCAPSULATION + body)))[0] == header


@given(st.binary(max_size=40))
def test_any_bytes_are_unpacked_or_refused(payload: bytes) -> None:
    try:
        _, body = unpack(payload)
    except CodecError:
        assert len(payload) < 20
    else:
        assert len(body) == len(payload) - 16


def test_a_header_of_the_other_byte_order_is_understood() -> None:
    payload = b"\0\0\0\0" + struct.pack(">Qq", 5, 6) + b"\x01"
    assert unpack(payload) == (Header(5, 6), b"\0\0\0\0\x01")


def test_a_reply_waits_until_its_reader_is_known(world: World) -> None:
    server = world.node("server")
    server.service("set", SET_BOOL, lambda request: SetBool.Response(True, "here"))
    world.until(world.node("other").client("set", SET_BOOL).ready)
    stranger = world.participant(world.node("stranger"))
    writer = stranger.writer("rq/setRequest", dds_name(f"{SET_BOOL}_Request"), Qos())
    world.until(lambda: writer.matched() == 1)
    time.sleep(0.02)
    writer.write(pack(Header(writer.handle, 1), serialize(SetBool.Request(True))))
    for _ in range(5):
        server.poll()
        time.sleep(0.002)
    reader = stranger.reader("rr/setReply", dds_name(f"{SET_BOOL}_Response"), Qos())
    samples: list[bytes] = []

    def arrived() -> bool:
        samples.extend(bytes(s.payload) for s in reader.take())
        return bool(samples)

    world.until(arrived)
    assert unpack(samples[0])[0] == Header(writer.handle, 1)


@pytest.fixture
def cyclone(domain: int) -> Iterator[RosNode]:
    pytest.importorskip("cyclonedds")
    from golem.middleware.dds.connect import connect
    from golem.middleware.dds.domain import DdsConfig

    participant = connect(DdsConfig(domain=domain))
    yield RosNode(participant, "here")
    participant.close()


def until(node: RosNode, condition: Callable[[], object]) -> Any:
    """Spin `node` until `condition()` is something, and return that."""
    for _ in range(1000):
        node.spin_once(0.01)
        if found := condition():
            return found
    raise AssertionError("nothing happened for too long")


def test_another_implementation_is_answered(cyclone: RosNode, domain: int) -> None:
    from .typed_peer import Endpoints, Request

    cyclone.service("set", SET_BOOL, lambda request: SetBool.Response(request.data, "here"))
    client = Endpoints(domain, server=False)
    until(cyclone, client.matched)
    client.writer.write(Request(2**63 + 5, 77, True))
    (reply,) = until(cyclone, lambda: client.reader.take(1))
    assert (reply.guid, reply.seq, reply.success, reply.message) == (2**63 + 5, 77, True, "here")


def test_another_implementation_answers(cyclone: RosNode, domain: int) -> None:
    from .typed_peer import Endpoints, Response

    client = cyclone.client("set", SET_BOOL)
    server = Endpoints(domain, server=True)
    until(cyclone, lambda: client.ready() and server.matched())
    answer = client.call(SetBool.Request(True))
    (request,) = until(cyclone, lambda: server.reader.take(1))
    server.writer.write(Response(request.guid + 1, request.seq, False, "for somebody else"))
    server.writer.write(Response(request.guid, request.seq, request.data, "there"))
    assert cyclone.wait(answer, 5.0) == SetBool.Response(True, "there")
