"""ROS types as IDL, as rosidl and rmw_cyclonedds put them on the wire, for the code generators of other makes."""

from __future__ import annotations

from typing import Any

from golem.middleware.ros.definitions import nested
from golem.middleware.ros.message import ARRAY, BASE, NAME, SEQUENCE, Definition

_PRIMITIVES = {
    "bool": "boolean",
    "byte": "octet",
    "uint8": "octet",
    "int8": "int8",
    "int16": "short",
    "uint16": "unsigned short",
    "int32": "long",
    "uint32": "unsigned long",
    "int64": "long long",
    "uint64": "unsigned long long",
    "float32": "float",
    "float64": "double",
}


def wire_name(name: str) -> str:
    """Return the name on the wire of a type, e.g. `std_msgs::msg::dds_::String_`."""
    package, kind, short = name.split("/")
    return f"{package}::{kind}::dds_::{short}_"


def idl(names: list[str], types: dict[str, Definition]) -> str:
    """Return the definitions of types and of all they need; requests and responses with rmw_cyclonedds' header."""
    return "\n".join(_struct(name, types[name]) for name in _ordered(names, types))


def _ordered(names: list[str], types: dict[str, Definition]) -> list[str]:
    done: dict[str, None] = {}

    def visit(name: str) -> None:
        if name not in done:
            for used in nested(types[name][1]):
                visit(used)
            done[name] = None

    for name in names:
        visit(name)
    return list(done)


def _struct(name: str, definition: Definition) -> str:
    package, kind, short = name.split("/")
    header = "unsigned long long guid_; long long sequence_; " if name.endswith(("_Request", "_Response")) else ""
    members = " ".join(_member(field, kind) for field, kind in definition[1])
    body = f"struct {short}_ {{ {header}{members} }};"
    return f"module {package} {{ module {kind} {{ module dds_ {{ {body} }}; }}; }};"


def _member(field: str, kind: tuple[int, Any]) -> str:
    what, of = kind
    if what == ARRAY:
        return f"{_type(of[0])} m_{field}[{of[1]}];"
    if what == SEQUENCE:
        return f"sequence<{_type(of[0])}{f', {of[1]}' if of[1] else ''}> m_{field};"
    return f"{_type(kind)} m_{field};"


def _type(kind: tuple[int, Any]) -> str:
    what, of = kind
    if what == NAME:
        return "::" + wire_name(of)
    assert what == BASE
    name, bound = of
    if name == "string":
        return f"string<{bound}>" if bound else "string"
    return _PRIMITIVES[name]
