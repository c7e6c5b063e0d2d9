"""Random messages of any type, and payloads that somebody has tampered with."""

from __future__ import annotations

import random
import struct
from typing import Any

import numpy as np

from golem.middleware.ros.codec import Codec
from golem.middleware.ros.definitions import EMPTY_MEMBER
from golem.middleware.ros.message import ARRAY, BASE, NAME

INTEGERS = {"byte": "b", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I"} | {
    "int64": "q",
    "uint64": "Q",
}
TEXTS = ("", "a", "base_link", "Schraube ø 8", "x" * 40)
EXTREMES = (0, 1, 2, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 0x10000, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)


def travelling(codec: Codec) -> list[str]:
    """Return the names of all types whose messages travel: not services and actions as a whole, nor their events."""
    names = codec.names()
    whole = {name.removesuffix(suffix) for name in names for suffix in ("_Request", "_Goal") if name.endswith(suffix)}
    return [name for name in names if name not in whole and not name.endswith("_Event")]


def random_message(codec: Codec, name: str, rng: random.Random) -> Any:
    """Return a message of type `name` whose fields hold random values."""
    _, fields = codec._types[name]
    return codec.message(name)(*(0 if field == EMPTY_MEMBER else _value(codec, kind, rng) for field, kind in fields))


def _value(codec: Codec, kind: tuple[int, Any], rng: random.Random) -> Any:
    what, of = kind
    if what == BASE:
        return _scalar(of[0], rng)
    if what == NAME:
        return random_message(codec, of, rng)
    element, length = of
    count = length if what == ARRAY else rng.randrange(min(length, 3) + 1 if length else 4)
    if element[0] == BASE and element[1][0] != "string":
        return np.array([_scalar(element[1][0], rng) for _ in range(count)], _dtype(element[1][0]))
    return [_value(codec, element, rng) for _ in range(count)]


def _scalar(kind: str, rng: random.Random) -> Any:
    if kind == "string":
        return rng.choice(TEXTS)
    if kind == "bool":
        return rng.random() < 0.5
    if kind == "float32":
        return float(np.float32(rng.gauss(0.0, 1e3)))
    if kind == "float64":
        return rng.gauss(0.0, 1e6)
    code = INTEGERS[kind]
    return struct.unpack(code, rng.randbytes(struct.calcsize(code)))[0]


def _dtype(kind: str) -> np.dtype[Any]:
    return np.dtype(bool if kind == "bool" else getattr(np, kind))


def mutated(payload: bytes, rng: random.Random) -> bytes:
    """Return `payload` with something wrong: bits flipped, counts replaced, cut off, repeated or padded."""
    data = bytearray(payload)
    for _ in range(rng.choice((1, 1, 2, 5))):
        what = rng.randrange(6)
        at = rng.randrange(len(data)) if data else 0
        if what == 0 and data:
            data[at] ^= 1 << rng.randrange(8)
        elif what == 1 and data:
            data[at] = rng.randrange(256)
        elif what == 2 and len(data) >= 8:
            at = 4 * rng.randrange(1, len(data) // 4)
            data[at : at + 4] = struct.pack("<I", rng.choice(EXTREMES))
        elif what == 3:
            del data[at:]
        elif what == 4:
            data[at:at] = data[: rng.randrange(64)]
        else:
            data += rng.randbytes(rng.randrange(16))
    return bytes(data)
