"""What a row of the public table says."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

from golem.middleware.bus import Topic
from golem.middleware.dds.base import Payload, Qos
from golem.middleware.ros import codec

Role = Literal["robot", "safety", "stack", "user"]
"""Who offers something: the robot (`golem twin`, or the H1-2 with its drivers), `golem safety`, `golem up`, anybody."""
VENDOR = ("unitree_hg", "unitree_api")
"""Packages of the messages that are written as images, past the ROS codec."""


@dataclass(frozen=True, slots=True)
class TopicRow:
    """A stream of messages.

    Attributes:
        name: in ROS 2.
        type: of its messages.
        by: who publishes it.
        to: who of GOLEM's own processes reads it.
        qos: what the publisher offers.
        rate: messages per second of robot time [Hz]; None where something has to happen first.
        frame: `frame_id` of its messages; empty where they have none.
        text: what it carries.
        key: stream of the bus that it carries; None where it is no such stream.
        encode: makes a message of a value, of the vendor's types a payload. None where that takes more than the value:
            the process that sends it then says how.
        decode: makes a value of a message, or of a payload. None where that takes more, or nobody of ours reads it.
        on_demand: whether a message is made only while somebody subscribes.
        thinned: whether `key` carries more values than `rate`, of which one per period is sent.
    """

    name: str
    type: str
    by: Role
    to: tuple[Role, ...]
    qos: Qos
    rate: float | None
    frame: str
    text: str
    key: Topic[Any] | None = None
    encode: Callable[[Any], Any] | None = None
    decode: Callable[[Any], Any] | None = None
    on_demand: bool = False
    thinned: bool = False

    @property
    def vendor(self) -> bool:
        """Whether it is the vendor's own."""
        return self.type.split("/")[0] in VENDOR

    def value(self, payload: Payload) -> Any:
        """Return the value in a payload, as it is on the wire or in a bag.

        Raises:
            CodecError, WireError: the payload is no such message, or the message no such value.
            ValueError: the row has no `decode`.
        """
        if self.decode is None:
            raise ValueError(f"the table does not say how to read {self.name}")
        return self.decode(payload if self.vendor else codec.deserialize(payload, codec.message(self.type)))


@dataclass(frozen=True, slots=True)
class ServiceRow:
    """A call with an answer: its name and type in ROS 2, who answers, and what it does."""

    name: str
    type: str
    by: Role
    text: str


@dataclass(frozen=True, slots=True)
class ActionRow:
    """A goal with feedback, a result, and a way to cancel it: see `ServiceRow`."""

    name: str
    type: str
    by: Role
    text: str
