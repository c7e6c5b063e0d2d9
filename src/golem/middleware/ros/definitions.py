"""Interface definitions: which types there are, and what each consists of.

The standard types of a ROS 2 distribution come from rosbags' type store; what GOLEM and its vendors add, and services
and actions, which the store lacks, from the files in `share` (`ros` in the repository): `<package>/msg/*.msg`,
`srv/*.srv` and `action/*.action`. A service stands for two messages and an event, an action for three messages, two
services and a feedback message, as rosidl derives them (design.ros2.org/articles/actions.html; rosidl_parser,
definition.py).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast, get_args

from golem.errors import needs, unknown_name
from golem.middleware.dds.domain import Distro
from golem.middleware.ros.message import ARRAY, BASE, NAME, SEQUENCE, Definition, Kind

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

SHARE = Path(__file__).parent / "share"
"""Folder of the interface packages."""
SEPARATOR = "---"
"""Line between the parts of a .srv or .action file."""
EMPTY_MEMBER = "structure_needs_at_least_one_member"
"""The member that stands in for the fields of a type without any, as in rosidl; one byte on the wire."""

Field = tuple[str, Kind]
"""Name and kind of a field."""
PARTS = {"msg": ("",), "srv": ("_Request", "_Response"), "action": ("_Goal", "_Result", "_Feedback")}
"""What is appended to the name of a file for each of its parts, by the kind of file."""


@cache
def sections() -> dict[str, str]:
    """Return the text of every message in the files of `share`, by type name.

    A part of a service or an action is named as in ROS: `std_srvs/srv/SetBool_Request`, `.../action/Pick_Goal`.
    """
    found: dict[str, str] = {}
    for kind, suffixes in PARTS.items():
        for path in sorted(SHARE.glob(f"*/{kind}/*.{kind}")):
            name = f"{path.parent.parent.name}/{kind}/{path.stem}"
            for suffix, text in zip(suffixes, split(path.read_text(encoding="utf-8")), strict=True):
                found[name + suffix] = text
    return found


def files(kind: str) -> list[str]:
    """Return the names of the interfaces of one kind (`msg`, `srv`, `action`) in `share`."""
    return [f"{path.parent.parent.name}/{kind}/{path.stem}" for path in sorted(SHARE.glob(f"*/{kind}/*"))]


def split(text: str) -> list[str]:
    """Return the parts of an interface file."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines(keepends=True):
        if line.strip() == SEPARATOR:
            parts.append([])
        else:
            parts[-1].append(line)
    return ["".join(lines) for lines in parts]


def load(distro: str) -> Typestore:
    """Return a type store with everything: the standard types of `distro`, and those of `share`.

    Raises:
        MissingExtra: rosbags is not installed.
        ConfigError: there is no such distribution.
    """
    with needs("rosbags", "dds"):
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    if distro not in get_args(Distro):
        raise unknown_name("ROS 2 distribution", distro, get_args(Distro))
    store = get_typestore(Stores[f"ROS2_{distro.upper()}"])
    types: dict[str, Definition] = {}
    for name, text in sections().items():
        # Read as a .msg, wherever it comes from: a type named without its package is a message of that package.
        package, _, stem = name.split("/")
        (types[name],) = cast(Any, get_types_from_msg(text, f"{package}/msg/{stem}")).values()
    for name in files("srv"):
        types |= service(name)
    for name in files("action"):
        types |= action(name)
    store.register(cast(Any, types))
    everything = cast(dict[str, Definition], store.fielddefs)
    for name, (constants, fields) in everything.items():
        # rosidl_adapter turns `char` into `uint8`; rosbags does not, and would hash ServiceEventInfo wrongly.
        everything[name] = (constants, [(field, _without_char(kind)) for field, kind in fields])
    return store


def service(name: str) -> dict[str, Definition]:
    """Return what rosidl derives from a service: its event, and the service as the type that its hash is of."""
    request, response, event = (f"{name}_{part}" for part in ("Request", "Response", "Event"))
    info, parts = (NAME, "service_msgs/msg/ServiceEventInfo"), {"request": request, "response": response}
    said = [("info", info), *((part, (SEQUENCE, ((NAME, kind), 1))) for part, kind in parts.items())]
    return {
        event: ([], said),
        name: ([], [(f"{part}_message", (NAME, kind)) for part, kind in {**parts, "event": event}.items()]),
    }


def action(name: str) -> dict[str, Definition]:
    """Return what rosidl derives from an action: two services, the feedback message, and the action as a type."""
    goal_id: Field = ("goal_id", (NAME, "unique_identifier_msgs/msg/UUID"))
    send_goal, get_result, feedback = f"{name}_SendGoal", f"{name}_GetResult", f"{name}_FeedbackMessage"
    return {
        f"{send_goal}_Request": ([], [goal_id, ("goal", (NAME, f"{name}_Goal"))]),
        f"{send_goal}_Response": (
            [],
            [("accepted", (BASE, ("bool", 0))), ("stamp", (NAME, "builtin_interfaces/msg/Time"))],
        ),
        f"{get_result}_Request": ([], [goal_id]),
        f"{get_result}_Response": ([], [("status", (BASE, ("int8", 0))), ("result", (NAME, f"{name}_Result"))]),
        feedback: ([], [goal_id, ("feedback", (NAME, f"{name}_Feedback"))]),
        **service(send_goal),
        **service(get_result),
        name: (
            [],
            [
                ("goal", (NAME, f"{name}_Goal")),
                ("result", (NAME, f"{name}_Result")),
                ("feedback", (NAME, f"{name}_Feedback")),
                ("send_goal_service", (NAME, send_goal)),
                ("get_result_service", (NAME, get_result)),
                ("feedback_message", (NAME, feedback)),
            ],
        ),
    }


def nested(fields: list[Field]) -> list[str]:
    """Return the names of the types that `fields` are made of, in order, each once."""
    kinds = (kind[1][0] if kind[0] in (ARRAY, SEQUENCE) else kind for _, kind in fields)
    return list(dict.fromkeys(kind[1] for kind in kinds if kind[0] == NAME))


def text(name: str, types: dict[str, Definition]) -> str:
    """Return the definition of type `name` as .msg files have it, with those it uses: MCAP's encoding `ros2msg`."""
    order = [name]
    for each in order:
        order += [used for used in nested(types[each][1]) if used not in order]
    blocks = ["\n".join(_lines(types[each])) for each in order]
    heads = [f"\n{'=' * 80}\nMSG: {_short(each)}\n" for each in order[1:]]
    return "".join(part for pair in zip(["", *heads], blocks, strict=True) for part in pair) + "\n"


def _lines(definition: Definition) -> list[str]:
    constants, fields = definition
    literals = [(f'"{value}"' if isinstance(value, str) else value) for *_, value in constants]
    written = [f"{kind} {name}={said}" for (name, kind, _), said in zip(constants, literals, strict=True)]
    return written + [f"{_spelled(kind)} {name}" for name, kind in fields if name != EMPTY_MEMBER]


def _spelled(kind: Kind) -> str:
    what, of = kind
    if what == BASE:
        primitive, bound = of
        return f"{primitive}<={bound}" if bound else primitive
    if what == NAME:
        return _short(of)
    element, length = of
    size = str(length) if what == ARRAY else f"<={length}" if length else ""
    return f"{_spelled(element)}[{size}]"


def _short(name: str) -> str:
    """Return a type's name as .msg files write it, `std_msgs/Header`.

    A .msg cannot name the parts of an action; they are called as if they were messages, `golem_interfaces/PickGoal`,
    since readers of bags take no other names and look them up in the same text only.
    """
    package, _, stem = name.split("/")
    return f"{package}/{stem.replace('_', '')}"


def _without_char(kind: Kind) -> Kind:
    what, of = kind
    if what == BASE:
        return what, ("uint8", of[1]) if of[0] == "char" else of
    return (what, (_without_char(of[0]), of[1])) if what in (ARRAY, SEQUENCE) else kind
