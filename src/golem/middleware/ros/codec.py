"""Messages to bytes and back: classical CDR (XCDR1) with its 4-byte encapsulation header, as ROS 2 writes it.

rosbags compiles the serialisers. Around them stands what it leaves to its caller: arrays are checked before their
bits are copied, and whatever arrives from a network ends in a message or in a `CodecError`, with memory in proportion
to the payload.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from golem.errors import unknown_name
from golem.middleware.dds.base import Payload
from golem.middleware.ros import definitions, msgs
from golem.middleware.ros import message as messages
from golem.middleware.ros.message import ARRAY, NAME, SEQUENCE, CodecError, Definition, Message, python_name

DEFAULT_DISTRO = "jazzy"
"""Distribution of the functions of this module; where the distribution matters, use `codec`."""
M = TypeVar("M", bound=Message)


class ServiceType(NamedTuple):
    """The messages of a service, and its type name."""

    name: str
    Request: type[Any]
    Response: type[Any]


class ActionType(NamedTuple):
    """The messages of an action, and its type name.

    Attributes:
        Goal, Result, Feedback: what its file defines.
        SendGoal, GetResult: the services by which a client sends a goal and gets the result.
        FeedbackMessage: what travels on its feedback topic.
    """

    name: str
    Goal: type[Any]
    Result: type[Any]
    Feedback: type[Any]
    SendGoal: ServiceType
    GetResult: ServiceType
    FeedbackMessage: type[Any]


@dataclass(frozen=True, slots=True)
class _Compiled:
    """rosbags' functions of one type, and the check that must precede them."""

    size: Callable[..., int]
    write: Callable[..., int]
    check: Callable[[Any], None] | None


class _Scratch(threading.local):
    """Where a thread writes its large messages: fresh pages for each image would cost ten times its copy."""

    small = 1 << 16

    def __init__(self) -> None:
        self._bytes = np.zeros(0, np.uint8)

    def zeros(self, size: int) -> memoryview:
        """Return `size` zero bytes, to be used before the next call."""
        if size <= self.small:
            return memoryview(bytearray(size))
        if self._bytes.size < size:
            self._bytes = np.empty(size, np.uint8)
        view = self._bytes[:size]
        view.fill(0)
        return view.data


class Codec:
    """Knows every type of one ROS 2 distribution, and GOLEM's."""

    def __init__(self, distro: str = DEFAULT_DISTRO) -> None:
        """Know the standard types of `distro`. Raises MissingExtra: no rosbags; ConfigError: no such distribution."""
        self._store = definitions.load(distro)
        self._types = cast(dict[str, Definition], self._store.fielddefs)
        self._classes: dict[str, type[Message]] = {}
        self._compiled: dict[str, _Compiled] = {}
        self._hashes: dict[str, str] = {}
        self._scratch = _Scratch()
        self._making = threading.RLock()

    def names(self) -> list[str]:
        """Return the names of all types, among them those of services and actions."""
        return sorted(self._types)

    def message(self, name: str) -> type[Any]:
        """Return the class of a message, e.g. `"sensor_msgs/msg/Image"` or `"std_srvs/srv/SetBool_Request"`.

        It is that of `golem.middleware.ros.msgs` where there is one. Raises ConfigError: there is no such type.
        """
        if name not in self._classes:
            self._known(name)
            with self._making:
                for used in definitions.nested(self._types[name][1]):
                    self.message(used)
                if name not in self._classes:
                    definition = self._types[name]
                    kept = name in msgs.DEFINITIONS
                    made = msgs.held(name) if kept else messages.message_class(name, definition, self.message, __name__)
                    self._store.types[name] = cast(Any, made)
                    self._classes[name] = made
        return self._classes[name]

    def service(self, name: str) -> ServiceType:
        """Return the messages of a service, e.g. `"std_srvs/srv/SetBool"`. Raises ConfigError: there is none."""
        self._known(f"{name}_Request", name)
        return ServiceType(name, self.message(f"{name}_Request"), self.message(f"{name}_Response"))

    def action(self, name: str) -> ActionType:
        """Return the messages of an action, e.g. `golem_interfaces/action/Pick`. Raises ConfigError: there is none."""
        self._known(f"{name}_Goal", name)
        goal, result, feedback = (self.message(f"{name}_{part}") for part in ("Goal", "Result", "Feedback"))
        services = self.service(f"{name}_SendGoal"), self.service(f"{name}_GetResult")
        return ActionType(name, goal, result, feedback, *services, self.message(f"{name}_FeedbackMessage"))

    def serialize(self, message: Message) -> bytes:
        """Return a message's CDR, little endian, padded to four bytes. Raises CodecError: a field is not as defined."""
        name = message.__msgtype__
        compiled = self._compiled.get(name) or self._compile(name)
        try:
            if compiled.check is not None:
                compiled.check(message)
            size = 4 + compiled.size(0, message, self._store)
            buffer = self._scratch.zeros(size + -size % 4)
            buffer[1] = 1
            compiled.write(buffer[4:], 0, message, self._store)
        except CodecError:
            raise
        except Exception as error:  # a field may hold anything
            raise CodecError(f"A {name} cannot be serialised: {_reason(error)}.") from error
        return bytes(buffer)

    def deserialize(self, payload: Payload, kind: type[M]) -> M:
        """Return the `kind` in `payload`, its arrays read-only views of that. Raises CodecError: it is none."""
        name = kind.__msgtype__
        if name not in self._compiled:
            self._compile(name)
        try:
            return cast(M, self._store.deserialize_cdr(memoryview(payload).cast("B"), name))
        except Exception as error:  # the bytes are a stranger's
            raise CodecError(f"{len(payload)} bytes are no {name}: {_reason(error)}.") from error

    def type_hash(self, name: str) -> str:
        """Return the RIHS01 hash of a message, service or action (REP-2011). Raises ConfigError: there is none."""
        self._known(name)
        if name not in self._hashes:
            self._hashes[name] = self._store.hash_rihs01(name)
        return self._hashes[name]

    def definition(self, name: str) -> str:
        """Return a type's definition, then those it uses, as in bags (`ros2msg`). Raises ConfigError: no such type."""
        self._known(name)
        return definitions.text(name, self._types)

    def _known(self, name: str, asked: str | None = None) -> None:
        if name in self._types:
            return
        wrong = asked or name
        package = wrong.split("/")[0]
        siblings = [each for each in self._types if each.startswith(f"{package}/") and "_" not in messages.short(each)]
        if siblings:
            raise unknown_name("ROS interface", wrong, siblings)
        raise unknown_name("ROS package", package, {each.split("/")[0] for each in self._types})

    def _compile(self, name: str) -> _Compiled:
        self.message(name)
        functions = self._store.get_msgdef(name)
        compiled = _Compiled(functions.getsize_cdr, functions.serialize_cdr_le, self._check(name))
        self._compiled[name] = compiled
        return compiled

    @functools.cache  # noqa: B019  a codec lives as long as its process
    def _check(self, name: str) -> Callable[[Any], None] | None:
        """Return what refuses a message of type `name` whose arrays are not of their types; None if it has none."""
        arrays: list[tuple[str, np.dtype[Any]]] = []
        deeper: list[tuple[str, bool, Callable[[Any], None]]] = []
        for field, (what, of) in self._types[name][1]:
            element = of[0] if what in (ARRAY, SEQUENCE) else (what, of)
            if element[0] == NAME:
                inner = self._check(element[1])
                if inner is not None:
                    deeper.append((python_name(field), what != NAME, inner))
            elif what in (ARRAY, SEQUENCE) and messages.is_numeric(element):
                arrays.append((python_name(field), np.dtype(getattr(np, messages.numpy_name(element[1][0])))))
        if not arrays and not deeper:
            return None

        def check(message: Any) -> None:
            for field, dtype in arrays:
                value = getattr(message, field)
                if (
                    type(value) is not np.ndarray
                    or value.dtype != dtype
                    or value.ndim != 1
                    or not value.flags.c_contiguous
                ):
                    raise CodecError(
                        f"'{field}' of a {name} must be a contiguous one-dimensional numpy array of {dtype}, "
                        f"not {_described(value)}."
                    )
            for field, many, inner in deeper:
                value = getattr(message, field)
                for each in value if many else (value,):
                    inner(each)

        return check


def _described(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"one of {value.dtype} with the shape {value.shape}"
    return f"{type(value).__name__}"


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}, {error}".rstrip(".")


@functools.cache
def codec(distro: str = DEFAULT_DISTRO) -> Codec:
    """Return the codec of a distribution, made once. Raises MissingExtra: no rosbags; ConfigError: no such one."""
    return Codec(distro)


def message(name: str) -> type[Any]:
    """See `Codec.message`."""
    return codec().message(name)


def service(name: str) -> ServiceType:
    """See `Codec.service`."""
    return codec().service(name)


def action(name: str) -> ActionType:
    """See `Codec.action`."""
    return codec().action(name)


def serialize(message: Message) -> bytes:
    """See `Codec.serialize`."""
    return codec().serialize(message)


def deserialize(payload: Payload, kind: type[M]) -> M:
    """See `Codec.deserialize`."""
    return codec().deserialize(payload, kind)


def type_hash(name: str) -> str:
    """See `Codec.type_hash`."""
    return codec().type_hash(name)


def definition(name: str) -> str:
    """See `Codec.definition`."""
    return codec().definition(name)


def check(where: str, message: Any, kind: type[Any]) -> None:
    """Raise CodecError unless `message` is a `kind`, as `where` prescribes it, e.g. `"Topic '/chatter'"`."""
    if not isinstance(message, kind):
        raise CodecError(f"{where} takes a {kind.__msgtype__} here, not {type(message).__name__}.")


def serialize_as(where: str, message: Any, kind: type[Any]) -> bytes:
    """Return the CDR of `message`, a `kind`; see `check`. Raises CodecError: it is none, or not as defined."""
    check(where, message, kind)
    return serialize(message)


def dds_name(kind: str | type[Message]) -> str:
    """Return what DDS calls a message type: `sensor_msgs::msg::dds_::Image_` for `"sensor_msgs/msg/Image"`."""
    package, sort, name = (kind if isinstance(kind, str) else kind.__msgtype__).split("/")
    return f"{package}::{sort}::dds_::{name}_"
