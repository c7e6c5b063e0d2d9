"""What every message class has in common, the errors of messages, and classes made from definitions of types."""

from __future__ import annotations

import keyword
import struct
from collections.abc import Callable
from dataclasses import Field, field, fields, make_dataclass
from typing import Any, ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from golem.errors import GolemError
from golem.middleware.dds.base import Payload


class Header(NamedTuple):
    """Pairs a reply with its request.

    A payload is CDR of the header followed by the body: the 64-bit handle of the client's request writer and a 64-bit
    sequence number, echoed by the reply (`cdds_request_header`, ros2/rmw_cyclonedds, serdata.hpp).

    Attributes:
        client: handle of the client's request writer (uint64), as the client knows it.
        sequence: number of the request, by its client (int64).
    """

    client: int
    sequence: int


def pack(header: Header, body: Payload) -> bytes:
    """Return the payload that carries `body` (CDR with encapsulation header, little endian) behind `header`.

    The header is 16 bytes long, so that the body keeps its alignment.
    """
    return b"".join((body[:4], struct.pack("<Qq", *header), body[4:]))


def unpack(payload: Payload) -> tuple[Header, bytes]:
    """Return header and body of a payload; the inverse of `pack`. Raises CodecError: it is too short."""
    if len(payload) < 20:
        raise CodecError(f"A service payload has at least 20 bytes, not {len(payload)}.")
    order = "<" if payload[1] & 1 else ">"
    return Header(*struct.unpack_from(f"{order}Qq", payload, 4)), b"".join((payload[:4], payload[20:]))


BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4
"""Kinds of a field: (BASE, (primitive, string bound)), (NAME, type), and (ARRAY or SEQUENCE, (element, length))."""
Kind = tuple[int, Any]
Definition = tuple[list[tuple[str, str, Any]], list[tuple[str, Kind]]]
"""Constants (name, type, value) and fields (name, kind) of a type."""
NOT_ZERO = {("geometry_msgs/msg/Quaternion", "w"): 1.0}
"""Fields whose default in the standard definitions is not zero; rosbags' store does not tell."""


def message_class(name: str, definition: Definition, of: Callable[[str], type[Any]], module: str) -> type[Any]:
    """Return a class for messages of type `name`.

    Args:
        of: gives the class of a type that a field is made of.
        module: what the class gives as its module.
    """
    constants, kinds = definition
    fields: list[tuple[str, Any, Field[Any]]] = []
    for label, kind in kinds:
        hint, default = _hint_and_default(kind, of)
        default = NOT_ZERO.get((name, label), default)
        made = field(default_factory=default) if callable(default) else field(default=default)
        fields.append((python_name(label), hint, cast("Field[Any]", made)))
    space = {"__doc__": f"Message `{name}`.", "__msgtype__": name}
    space |= {constant: value for constant, _, value in constants}
    made = make_dataclass(short(name), fields, bases=(Message,), namespace=space, slots=True, eq=False)
    made.__module__ = module
    return made


def python_name(label: str) -> str:
    """Return the attribute of a field, as rosbags calls it: a Python keyword gets an underscore behind it."""
    return f"{label}_" if keyword.iskeyword(label) else label


def numpy_name(primitive: str) -> str:
    """Return the numpy type of a primitive, as rosbags reads it."""
    return {"bool": "bool_"}.get(primitive, primitive)


def short(name: str) -> str:
    """Return the class name of a type: the last part of its name."""
    return name.rsplit("/", 1)[1]


def python_type(primitive: str) -> type[bool | str | float | int]:
    """Return the type of the value of one primitive."""
    return {"bool": bool, "string": str}.get(primitive, float if primitive.startswith("float") else int)


def is_numeric(element: Kind) -> bool:
    """Return whether an array or a sequence of `element` is a numpy array."""
    return element[0] == BASE and element[1][0] != "string"


def _hint_and_default(kind: Kind, of: Callable[[str], type[Any]]) -> tuple[Any, Any]:
    """Return the type of a field and its default: a value, or a function that makes one."""
    what, inner = kind
    if what == BASE:
        return python_type(inner[0]), python_type(inner[0])()
    if what == NAME:
        return of(inner), of(inner)
    element, length = inner
    fixed = length if what == ARRAY else 0
    if is_numeric(element):
        dtype = getattr(np, numpy_name(element[1][0]))
        return NDArray[dtype], lambda: np.zeros(fixed, dtype)
    hint, default = _hint_and_default(element, of)
    return list[hint], lambda: [default() if callable(default) else default for _ in range(fixed)]


NANO = 1_000_000_000
"""Nanoseconds in a second: ROS counts time in both."""


class CodecError(GolemError):
    """A message cannot be written as its type says, or bytes are not a message of the type they should be of."""


class Message:
    """A ROS message: a dataclass whose fields are those of its definition, each with the default of ROS.

    Numbers are Python's; a sequence or array of numbers is a one-dimensional numpy array of the definition's very
    type, any other sequence a list. Two messages are equal if they have the same type and equal fields; NaN is not
    equal to NaN.

    Attributes:
        __msgtype__: name of the type, e.g. `"sensor_msgs/msg/Image"`.
    """

    __slots__ = ()
    __msgtype__: ClassVar[str]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Message) or other.__msgtype__ != self.__msgtype__:
            return NotImplemented
        return all(_equal(getattr(self, f.name), getattr(other, f.name)) for f in fields(self))  # type: ignore[arg-type]

    __hash__ = None  # type: ignore[assignment]


def _equal(a: object, b: object) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.array_equal(np.asarray(a), np.asarray(b))
    return a == b
