"""A minimal CDR encoder and random messages: what the tests send, written down apart from GOLEM's codecs."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable

from golem.middleware.dds.base import ENCAPSULATION


class Cdr:
    """Appends values at their natural alignment, little endian."""

    def __init__(self) -> None:
        self.body = bytearray()

    def put(self, code: str, *values: float) -> None:
        size = struct.calcsize(code)
        for value in values:
            self.body += bytes(-len(self.body) % size) + struct.pack("<" + code, value)

    def text(self, value: str) -> None:
        self.octets(value.encode() + b"\0")

    def octets(self, value: bytes) -> None:
        self.put("I", len(value))
        self.body += value

    def sample(self) -> bytes:
        return ENCAPSULATION + bytes(self.body)


def header(cdr: Cdr, rng: random.Random) -> None:
    cdr.put("i", rng.randrange(2**31))
    cdr.put("I", rng.randrange(10**9))
    cdr.text("frame" * rng.randrange(4))


def string(cdr: Cdr, rng: random.Random) -> None:
    cdr.text("a" * rng.randrange(64))


def twist(cdr: Cdr, rng: random.Random) -> None:
    cdr.put("d", *(rng.uniform(-9, 9) for _ in range(6)))


def joint_state(cdr: Cdr, rng: random.Random) -> None:
    header(cdr, rng)
    cdr.put("I", 27)
    for i in range(27):
        cdr.text(f"joint_{i}")
    for _ in range(3):
        cdr.put("I", 27)
        cdr.put("d", *(rng.uniform(-9, 9) for _ in range(27)))


def image(cdr: Cdr, rng: random.Random, height: int = 48, width: int = 64) -> None:
    header(cdr, rng)
    cdr.put("I", height, width)
    cdr.text("rgb8")
    cdr.put("B", 0)
    cdr.put("I", 3 * width)
    cdr.octets(rng.randbytes(height * 3 * width))


def cloud(cdr: Cdr, rng: random.Random) -> None:
    header(cdr, rng)
    cdr.put("I", 1, 100, 3)
    for i, name in enumerate("xyz"):
        cdr.text(name)
        cdr.put("I", 4 * i)
        cdr.put("B", 7)
        cdr.put("I", 1)
    cdr.put("B", 0)
    cdr.put("I", 12, 1200)
    cdr.octets(rng.randbytes(1200))
    cdr.put("B", 1)


def low_state(cdr: Cdr, rng: random.Random) -> None:
    def floats(n: int) -> None:
        cdr.put("f", *(rng.uniform(-9, 9) for _ in range(n)))

    def words(n: int) -> None:
        cdr.put("I", *(rng.randrange(2**32) for _ in range(n)))

    words(2)
    cdr.put("B", 0, 5)
    words(1)
    floats(13)
    cdr.put("h", -40)
    for _ in range(35):
        cdr.put("B", 1)
        floats(4)
        cdr.put("h", 31, -7)
        floats(1)
        words(7)
    cdr.put("B", *rng.randbytes(40))
    words(5)


def low_cmd(cdr: Cdr, rng: random.Random) -> None:
    cdr.put("B", 0, 5)
    for _ in range(35):
        cdr.put("B", 1)
        cdr.put("f", *(rng.uniform(-9, 9) for _ in range(5)))
        cdr.put("I", rng.randrange(2**32))
    cdr.put("I", *(rng.randrange(2**32) for _ in range(5)))


MESSAGES: dict[str, Callable[[Cdr, random.Random], None]] = {
    "std_msgs::msg::dds_::String_": string,
    "geometry_msgs::msg::dds_::Twist_": twist,
    "sensor_msgs::msg::dds_::JointState_": joint_state,
    "sensor_msgs::msg::dds_::Image_": image,
    "sensor_msgs::msg::dds_::PointCloud2_": cloud,
    "unitree_hg::msg::dds_::LowState_": low_state,
    "unitree_hg::msg::dds_::LowCmd_": low_cmd,
}
"""How to fill a message of each type, by its name on the wire."""


def message(type_name: str, seed: int) -> bytes:
    """Return a random message of a type, with its encapsulation header."""
    cdr = Cdr()
    MESSAGES[type_name](cdr, random.Random(seed))
    return cdr.sample()
