"""Bags of others: what is not of ROS 2 is named and left out, and what is no MCAP file is called what it is."""

from __future__ import annotations

import struct
import threading
from collections.abc import Mapping
from pathlib import Path

import pytest

pytest.importorskip("mcap")
pytest.importorskip("rosbags")

from mcap.writer import Writer

from golem.errors import ConfigError
from golem.middleware.bags.base import BagError
from golem.middleware.bags.player import PlayConfig, Player
from golem.middleware.bags.reader import Bag, repair
from golem.middleware.dds.local import LocalDomain


def text(words: str, order: str = "<") -> bytes:
    """Return a std_msgs/msg/String, little or big endian."""
    data = words.encode() + b"\0"
    return bytes([0, order == "<", 0, 0]) + struct.pack(f"{order}I", len(data)) + data


Channel = tuple[str, str, str, bytes] | tuple[str]
"""Encoding of the messages, then encoding, name and text of their schema."""
STRING: Channel = ("cdr", "ros2msg", "std_msgs/msg/String", b"string data")
FOREIGN: dict[str, tuple[Channel, bytes, str]] = {
    "json": (("json", "jsonschema", "Foo", b"{}"), b'{"a": 1}', "'json', not 'cdr'"),
    "protobuf": (("protobuf", "protobuf", "foxglove.Log", b"x"), b"\x0a\x01a", "'protobuf', not 'cdr'"),
    "ros1": (("ros1", "ros1msg", "std_msgs/String", b"string data"), b"\2\0\0\0hi", "'ros1', not 'cdr'"),
    "flatbuffer": (("flatbuffer", "flatbuffer", "a.B", b"x"), b"\0" * 8, "'flatbuffer', not 'cdr'"),
    "no schema": (("cdr",), text("hi"), "its type is ''"),
    "a type with one slash": (("cdr", "ros2msg", "std_msgs/String", b""), text("hi"), "'std_msgs/String'"),
}


def write(path: Path, channels: Mapping[str, tuple[Channel, list[bytes]]], chunks: bool = True) -> None:
    """Write an MCAP file: per topic its encoding, schema and messages, 10 ms apart."""
    with path.open("wb") as file:
        writer = Writer(file, use_chunking=chunks)
        writer.start(profile="", library="x")
        for topic, ((encoding, *schema), payloads) in channels.items():
            number = 0
            if schema:
                kind, name, data = schema
                number = writer.register_schema(name=name, encoding=kind, data=bytes(data))  # pyright: ignore
            channel = writer.register_channel(topic=topic, message_encoding=encoding, schema_id=number)
            for k, payload in enumerate(payloads):
                at = 10**9 + k * 10**7
                writer.add_message(channel, log_time=at, publish_time=at, data=payload)
        writer.finish()


@pytest.mark.parametrize("chunks", [True, False], ids=["chunks", "no chunks"])
@pytest.mark.parametrize("kind", FOREIGN)
def test_what_is_not_of_ros_2_is_named_and_the_rest_is_played(kind: str, chunks: bool, tmp_path: Path) -> None:
    channel, payload, why = FOREIGN[kind]
    sound = [text(f"hi {k}") for k in range(5)]
    path = tmp_path / "mixed.mcap"
    write(path, {"/foreign": (channel, [payload] * 3), "/chatter": (STRING, sound)}, chunks)
    bag = Bag(path)
    assert list(bag.topics) == ["/chatter"] and list(bag.foreign) == ["/foreign"]
    assert why in bag.foreign["/foreign"]
    assert [bytes(message.payload) for message in bag.messages()] == sound
    domain = LocalDomain()
    player = Player(bag, domain.participant(), PlayConfig(rate=100.0, wait=0.0))
    assert player.run(threading.Event()) == 5
    with pytest.raises(ConfigError, match=r"/foreign in .* cannot be played: its"):
        Player(bag, domain.participant(), PlayConfig(topics=("/foreign",)))
    with pytest.raises(BagError, match="which a repair would lose: /foreign"):
        repair(tmp_path)


def test_a_message_that_cannot_be_played_is_named_with_its_place(tmp_path: Path) -> None:
    path = tmp_path / "be.mcap"
    write(path, {"/chatter": (STRING, [text("a"), text("b"), text("c", ">")])})
    player = Player(Bag(path), LocalDomain().participant(), PlayConfig(rate=100.0, wait=0.0))
    with pytest.raises(BagError, match=r"be.mcap, 0.020 s after its beginning: .*chatter.* 00 00 00 00"):
        player.run(threading.Event())


@pytest.mark.parametrize(
    ("name", "head", "what"),
    [
        ("a.bag", b"#ROSBAG V2.0\n", r"is a bag of ROS 1.*rosbags-convert --src .*a.bag --dst"),
        ("a.db3", b"SQLite format 3\0", r"is a bag in SQLite.*rosbags-convert"),
        ("a.mcap", b"version https://git-lfs.github.com/spec/v1\n", "is a pointer of Git LFS.*git lfs pull"),
        ("a.mcap", b"PK\x03\x04", "is no MCAP file"),
        ("a.mcap", b"\x89MCAP1\r\n", "is no MCAP file"),
    ],
)
def test_what_is_no_mcap_file_is_called_what_it_is(name: str, head: bytes, what: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(head + bytes(200))
    for path in (tmp_path, tmp_path / name):  # also the folder of rosbag2
        with pytest.raises(BagError, match=what) as refusal:
            Bag(path)
        assert "damaged" not in str(refusal.value)
