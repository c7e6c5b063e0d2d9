"""What is recorded, and where it goes: topics, messages, sinks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from golem.errors import GolemError
from golem.middleware.dds.base import DEFAULT, Payload, Qos


class BagError(GolemError):
    """A bag cannot be read: it is no bag, or a part of it is damaged."""


@dataclass(frozen=True, slots=True)
class BagTopic:
    """One recorded topic, with all that a reader needs to understand its messages.

    Attributes:
        name: as in ROS, e.g. `/lowstate`.
        kind: type of its messages, e.g. `unitree_hg/msg/LowState`.
        definition: the type in the language of .msg files, followed by those it uses (MCAP's schema encoding
            `ros2msg`).
        qos: what its writer offered.
        type_hash: RIHS01 hash of the type; empty where it is not known.
    """

    name: str
    kind: str
    definition: str
    qos: Qos = DEFAULT
    type_hash: str = ""

    @property
    def user_data(self) -> str:
        """What an endpoint of this topic says about its type during discovery, as ROS 2 does from Iron on."""
        return f"typehash={self.type_hash};" if self.type_hash else ""


@dataclass(frozen=True, slots=True)
class BagMessage:
    """One recorded message.

    Attributes:
        log_time: when it was recorded [ns]: since 1970, or since the start of an episode in lock-step.
        publish_time: when it was published [ns], by the publisher's clock.
        payload: CDR with its encapsulation header.
    """

    topic: BagTopic
    log_time: int
    publish_time: int
    payload: Payload


class Sink(Protocol):
    """Takes messages: a bag, or viewers."""

    def write(self, message: BagMessage) -> None:
        """Take one message. Raises OutputError: it cannot be written."""

    def close(self) -> None:
        """Complete what was written; calling it again does nothing."""
