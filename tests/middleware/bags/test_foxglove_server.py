from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

pytest.importorskip("foxglove")
pytest.importorskip("rosbags")

from rosbags.typesys import Stores, get_typestore
from websockets.exceptions import InvalidStatus
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin, Subprotocol

from golem.errors import ConfigError
from golem.middleware.bags.base import BagMessage, BagTopic
from golem.middleware.bags.foxglove_server import FoxgloveServer, ServerConfig
from golem.middleware.dds.base import DEFAULT, LATCHED, Qos

STORE = get_typestore(Stores.ROS2_HUMBLE)
STRING = STORE.generate_msgdef("std_msgs/msg/String", ros_version=2)[0]


def message(name: str, text: str, time: int, qos: Qos = DEFAULT) -> BagMessage:
    topic = BagTopic(name, "std_msgs/msg/String", STRING, qos)
    value = STORE.types[topic.kind](text)
    return BagMessage(topic, time, time, memoryview(STORE.serialize_cdr(value, topic.kind)))


class Viewer:
    """Speaks the client's side of the protocol (foxglove.dev, ws-protocol, docs/spec.md)."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self.info = self._json("serverInfo")

    def _json(self, op: str) -> dict[str, Any]:
        while True:
            frame = self._socket.recv(10.0)
            if isinstance(frame, str) and json.loads(frame)["op"] == op:
                return json.loads(frame)

    def channel(self) -> dict[str, Any]:
        """Return the next advertised channel."""
        return self._json("advertise")["channels"][0]

    def subscribe(self, channel: dict[str, Any], id: int) -> None:
        subscription = {"id": id, "channelId": channel["id"]}
        self._socket.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))

    def binary(self, opcode: int) -> bytes:
        """Return the rest of the next binary frame of one kind."""
        while True:
            frame = self._socket.recv(10.0)
            if isinstance(frame, bytes) and frame[0] == opcode:
                return frame[1:]

    def message(self) -> tuple[int, int, str]:
        """Return subscription, log time and text of the next message."""
        data = self.binary(1)
        text = getattr(STORE.deserialize_cdr(data[12:], "std_msgs/msg/String"), "data", "")
        return int.from_bytes(data[:4], "little"), int.from_bytes(data[4:12], "little"), text


@pytest.fixture
def server() -> Iterator[FoxgloveServer]:
    server = FoxgloveServer(ServerConfig(port=0))
    yield server
    server.close()


@pytest.fixture
def viewer(server: FoxgloveServer) -> Iterator[Viewer]:
    with connect(server.url, subprotocols=[Subprotocol("foxglove.sdk.v1")]) as socket:
        assert isinstance(socket, ClientConnection)
        yield Viewer(socket)


def until_wanted(server: FoxgloveServer, topic: BagTopic) -> None:
    while not server.wanted(topic):
        pass  # the test's time limit ends a server that never hears of it


def test_a_viewer_gets_schema_time_and_cdr(server: FoxgloveServer, viewer: Viewer) -> None:
    assert viewer.info["name"] == "golem" and "time" in viewer.info["capabilities"]
    first = message("/words", "unheard", 1)
    server.write(first)
    assert not server.wanted(first.topic)
    channel = viewer.channel()
    assert channel["topic"] == "/words" and channel["encoding"] == "cdr"
    assert channel["schemaName"] == "std_msgs/msg/String"
    assert channel["schema"] == STRING and channel["schemaEncoding"] == "ros2msg"
    viewer.subscribe(channel, 7)
    until_wanted(server, first.topic)
    server.write(message("/words", "heard", 123_456))
    assert viewer.message() == (7, 123_456, "heard")
    server.write(message("/words", "again", 123_999))
    server.write(message("/words", "much later", 900_000_000))
    assert int.from_bytes(viewer.binary(2), "little") == 900_000_000


def test_what_holds_is_repeated_to_those_who_come_later(server: FoxgloveServer, viewer: Viewer) -> None:
    server.write(message("/robot_description", "the model", 5, LATCHED))
    server.write(message("/words", "something else", 900))
    viewer.subscribe(viewer.channel(), 1)
    with ThreadPoolExecutor(1) as pool:
        heard = pool.submit(viewer.message)
        while not heard.done():
            server.refresh()
        assert heard.result() == (1, 900, "the model")


def test_a_page_of_a_stranger_is_refused_and_foxgloves_is_not(server: FoxgloveServer) -> None:
    protocol = [Subprotocol("foxglove.sdk.v1")]
    connect(server.url, origin=Origin("https://app.foxglove.dev"), subprotocols=protocol).close()
    with pytest.raises(InvalidStatus, match="403"):
        connect(server.url, origin=Origin("https://stranger.example"), subprotocols=protocol)


def test_a_port_that_is_taken_is_named() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(ConfigError, match=f"Cannot listen on 127.0.0.1:{port}"):
            FoxgloveServer(ServerConfig(port=port))
