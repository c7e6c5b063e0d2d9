"""A client of Fast DDS, played by hand, is answered as rmw_fastrtps expects; `tests/interop` has real ones."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from contextlib import closing, suppress
from typing import Any

import pytest

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from golem.middleware.dds.connect import connect
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.ros import codec
from golem.middleware.ros.msgs.std_srvs import SetBool_Request, SetBool_Response
from golem.middleware.ros.node import RosNode
from golem.middleware.ros.node_endpoints import PARTICIPANT_USER_DATA
from golem.middleware.ros.service import LARGEST, Origin, Responder
from golem.middleware.rtps import announcements, submessages
from golem.middleware.rtps.announcements import SPDP_READER, SPDP_WRITER, WRITERS_READER, WRITERS_WRITER
from golem.middleware.rtps.service_link import GROUP
from golem.middleware.rtps.submessages import FAST_DDS, HEADER, VERSION, Data, Heartbeat

REQUESTS, REPLIES = bytes.fromhex("00000103"), bytes.fromhex("00000204")
PREFIX = FAST_DDS + bytes(range(10))


class Client:
    """A participant that says that it is Fast DDS, with one client of one service.

    Its server is who offers "/set": participants that other tests of this machine left open may answer, too.
    """

    def __init__(self, domain: int) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(0.05)
        self.group = (GROUP, 7400 + 250 * domain)
        self.heard: list[submessages.Submessage] = []
        self.server = b""
        self.address: Any = None

    def send(self, *parts: bytes, address: Any = None) -> None:
        head = HEADER.pack(b"RTPS", VERSION, FAST_DDS, PREFIX)
        self.socket.sendto(head + b"".join(parts), address or self.address)

    def announce(self) -> None:
        own = announcements.own_participant(PREFIX, "127.0.0.1", self.socket.getsockname()[1], 20.0)
        self.socket.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        self.send(submessages.data(SPDP_WRITER, SPDP_READER, 1, b"", own), address=self.group)
        self.listen()

    def listen(self) -> None:
        with suppress(TimeoutError):
            while True:
                datagram, address = self.socket.recvfrom(65536)
                vendor, server, parts = submessages.parse(datagram, PREFIX)
                if vendor != submessages.NO_VENDOR:  # Cyclone answers, too
                    continue
                if any("rq/setRequest" in topics(part) for part in parts):
                    self.address, self.server = address, server
                self.heard += parts
                for part in parts:
                    if isinstance(part, Heartbeat):
                        reader = part.writer[12:15] + (b"\xc7" if part.writer[15] == 0xC2 else b"\x04")
                        ack = submessages.ack_nack(reader, part.writer[12:], part.last + 1, (), 1)
                        self.send(ack, address=address)

    def learn(self, topic: str) -> None:
        guid = PREFIX + REQUESTS
        said = announcements.own_endpoint(guid, topic, "std_srvs::srv::dds_::SetBool_Request_", "")
        self.send(submessages.data(WRITERS_WRITER, WRITERS_READER, 1, b"", said))

    def ask(self, sequence: int, request: Any) -> None:
        qos = submessages.related_sample(PREFIX + REPLIES, 0)
        body = bytes(codec.serialize(request))
        self.send(submessages.data(REQUESTS, submessages.ANY_ENTITY, sequence, qos, body))

    def replies(self) -> list[Data]:
        return [part for part in self.heard if isinstance(part, Data) and part.reader_id == REPLIES]


@pytest.fixture
def server(domain: int) -> Iterator[tuple[RosNode, int]]:
    with closing(connect(DdsConfig(domain=domain), PARTICIPANT_USER_DATA)) as participant:
        with closing(RosNode(participant, "server")) as node:
            node.service("/set", "std_srvs/srv/SetBool", lambda asked: SetBool_Response(asked.data, "done"))
            yield node, domain


def until(node: RosNode, client: Client, condition: Any) -> None:
    end = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < end, "nothing came for too long"
        node.poll()
        client.listen()


def test_a_request_is_answered_once_and_to_its_client(server: tuple[RosNode, int]) -> None:
    node, domain = server
    client = Client(domain)
    client.announce()
    until(node, client, lambda: client.server)
    client.learn("rq/setRequest")
    for _ in range(2):  # a sample that is sent again is the same request
        client.ask(1, SetBool_Request(True))
    client.ask(2, SetBool_Request(False))
    until(node, client, lambda: len({part.sequence for part in client.replies()}) == 2)
    client.listen()
    answers = {part.related: codec.deserialize(part.payload, SetBool_Response) for part in client.replies()}
    assert {related: answer.success for related, answer in answers.items()} == {
        (PREFIX + REPLIES, 1): True,
        (PREFIX + REPLIES, 2): False,
    }


def test_an_answer_too_large_for_a_datagram_ends_nobody_and_is_answered_for(server: tuple[RosNode, int]) -> None:
    """An action gives its result whenever its skill ends, where no guard of callbacks stands around it."""
    node, domain = server
    origins, told = list[Origin](), list[str]()
    responder = Responder(node._endpoints, "/set", "std_srvs/srv/SetBool", lambda origin, _: origins.append(origin))
    node.guard.log = told.append
    client = Client(domain)
    client.announce()
    until(node, client, lambda: client.server)
    client.learn("rq/setRequest")
    client.ask(1, SetBool_Request(True))
    until(node, client, lambda: any(origin.linked for origin in origins))
    large = codec.serialize(SetBool_Response(True, "x" * 70_000))
    responder.reply(next(origin for origin in origins if origin.linked), large)
    until(node, client, client.replies)
    assert codec.deserialize(client.replies()[0].payload, SetBool_Response) == SetBool_Response()
    assert "'/set'" in told[0] and "rmw_cyclonedds_cpp" in told[0]
    largest = codec.serialize(SetBool_Response(True, "x" * (LARGEST - 13)))
    assert len(largest) == LARGEST
    responder.reply(next(origin for origin in origins if origin.linked), largest)
    until(node, client, lambda: len(client.replies()) > 1)


def test_a_server_that_closes_says_goodbye(server: tuple[RosNode, int]) -> None:
    node, domain = server
    client = Client(domain)
    client.announce()
    until(node, client, lambda: client.server)
    node.close()
    client.listen()
    gone = [part for part in client.heard if isinstance(part, Data) and part.disposed]
    assert client.server + announcements.PARTICIPANT in {part.key for part in gone}


def test_noise_is_counted_and_changes_nothing(server: tuple[RosNode, int]) -> None:
    node, domain = server
    client = Client(domain)
    client.announce()
    until(node, client, lambda: client.server)
    client.send(struct.pack("<BBH", submessages.DATA, 1, 400))
    client.send(submessages.data(SPDP_WRITER, SPDP_READER, 2, b"", b"\x00\x03\x00\x00"))

    def answered() -> bool:
        client.learn("rq/setRequest")  # what is lost is sent again
        client.ask(1, SetBool_Request(True))
        return bool(client.replies())

    until(node, client, answered)


def topics(part: submessages.Submessage) -> str:
    try:
        return announcements.endpoint(part)[1] if isinstance(part, Data) else ""
    except (ValueError, struct.error):
        return ""
