"""The transport contract: participants with writers and readers of serialised samples.

Topic and type names are those on the wire (`rt/lowstate`, `unitree_hg::msg::dds_::LowState_`). Payloads are CDR with
its 4-byte encapsulation header (XCDR1, little endian: `00 01 00 00`); what they mean is the codecs' business. All
types are keyless, as in ROS 2. A writer and a reader match if topic and type name are equal and the writer offers what
the reader requests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from golem.errors import GolemError

ENCAPSULATION = b"\x00\x01\x00\x00"
"""Header of a payload: CDR, little endian, no options (DDSI-RTPS 2.5, 10.2.1.2)."""

Payload = bytes | bytearray | memoryview
"""Serialised sample with its encapsulation header; C-contiguous."""


class DdsError(GolemError):
    """The transport cannot do what it was asked: the message says what to change."""


def as_sample(topic: str, payload: Payload) -> bytes:
    """Return `payload` as bytes, for a writer of `topic`.

    Raises:
        DdsError: it is no little-endian XCDR1, or has nothing after its header (ROS 2 gives an empty message an octet).
    """
    data = payload if isinstance(payload, bytes) else bytes(payload)
    if len(data) <= len(ENCAPSULATION) or not data.startswith(ENCAPSULATION[:2]):
        raise DdsError(
            f"A sample of '{topic}' is a CDR header (00 01 00 00) and at least a byte, not {data[:5].hex(' ') or '-'}."
        )
    return data


@dataclass(frozen=True, slots=True)
class Qos:
    """Quality of service of one endpoint.

    Attributes:
        reliable: lost samples are sent again; else best effort.
        transient_local: a late reader that asks for it gets the writer's last `depth` samples.
        depth: samples a writer or reader keeps (keep last); None keeps all.
    """

    reliable: bool = True
    transient_local: bool = False
    depth: int | None = 10

    def __post_init__(self) -> None:
        if self.depth is not None and self.depth < 1:
            raise ValueError(f"a history keeps at least one sample, not {self.depth}")

    def offers(self, requested: Qos) -> bool:
        """Return whether a writer with this QoS satisfies a reader that requests `requested`."""
        return self.reliable >= requested.reliable and self.transient_local >= requested.transient_local


SENSOR = Qos(reliable=False, depth=5)
"""ROS 2's sensor data profile."""
DEFAULT = Qos()
"""ROS 2's default profile, which its services use too."""
CALLS = Qos(depth=256)
"""For remote calls: as deep as answers to everybody may pile up while one client is busy elsewhere [own]."""
LATCHED = Qos(transient_local=True, depth=1)
"""For what is said once and holds: /tf_static, /robot_description, a status."""


@dataclass(frozen=True, slots=True)
class Sample:
    """One sample as taken from a reader.

    Attributes:
        payload: CDR with its encapsulation header and up to 3 bytes of padding; empty if not `alive`.
        source_time: when the writer wrote it, by the writer's clock [s since 1970].
        writer: instance handle (uint64) of the writer as the reader's participant knows it.
        alive: False for the notice, without payload, that the last matched writer of the topic has gone (or that
            one disposed of it, as writers of other makes may when they close).
    """

    payload: bytes
    source_time: float
    writer: int
    alive: bool = True


class Writer(Protocol):
    """Sends samples of one topic.

    Attributes:
        guid: 16 bytes, unique on the domain.
        handle: instance handle (uint64) by which its own participant knows it.
        dropped: samples that were not sent because a reliable reader was too far behind.
    """

    guid: bytes
    handle: int
    dropped: int

    def write(self, payload: Payload) -> None:
        """Send one sample; `payload` may be changed once this returns.

        Where a reliable reader is so far behind that much waits for it already, this waits up to 0.1 s, then drops the
        sample and counts it in `dropped`: a stalled peer must not stop the robot's process. Raises DdsError: it is no
        CDR, or the writer is closed.
        """

    def matched(self) -> int:
        """Return how many readers match now."""
        ...

    def readers(self) -> dict[int, bytes]:
        """Return the guid (16 bytes) of every reader that matches now, by its instance handle.

        The first 12 bytes of a guid are those of its participant.
        """
        ...

    def close(self) -> None:
        """Leave the domain; calling it again does nothing."""


class Reader(Protocol):
    """Receives samples of one topic.

    Attributes:
        guid: 16 bytes, unique on the domain.
        handle: instance handle (uint64) by which its own participant knows it.
    """

    guid: bytes
    handle: int

    def take(self, maximum: int = 64) -> list[Sample]:
        """Remove and return up to `maximum` samples, oldest first, or none. Raises DdsError: the reader is closed."""
        ...

    def matched(self) -> int:
        """Return how many writers match now."""
        ...

    def writers(self) -> dict[int, bytes]:
        """Return the guid (16 bytes) of every writer that matches now, by its instance handle (`Sample.writer`)."""
        ...

    def close(self) -> None:
        """Leave the domain; calling it again does nothing."""


@dataclass(frozen=True, slots=True)
class NetworkPlace:
    """Where a domain is on a network: its id, and the IPv4 address that this machine has there."""

    domain: int
    address: str


class Participant(Protocol):
    """Membership of a domain.

    Attributes:
        guid: 16 bytes, unique on the domain.
        network: where it is; None in one process, and where this machine's address is not known.
    """

    guid: bytes
    network: NetworkPlace | None

    def writer(self, topic: str, type_name: str, qos: Qos, user_data: str = "") -> Writer:
        """Create a writer. Raises DdsError: this participant already uses `topic` with another type, or is closed.

        Args:
            topic: name of the topic as on the wire.
            type_name: name of its type as on the wire.
            qos: what it offers.
            user_data: USER_DATA that peers see during discovery.
        """
        ...

    def reader(
        self, topic: str, type_name: str, qos: Qos, user_data: str = "", on_data: Callable[[], None] | None = None
    ) -> Reader:
        """Create a reader. Raises DdsError: as for a writer.

        Args:
            topic: name of the topic as on the wire.
            type_name: name of its type as on the wire.
            qos: what it requests.
            user_data: USER_DATA that peers see during discovery.
            on_data: called when there is something to take, one call at a time for all readers of the participant.
                It must take, may write, and must not wait for another callback. The first call may come before this
                method has returned; then it may leave the samples, and take them itself once it has the reader.
        """
        ...

    def close(self) -> None:
        """Close every writer and reader and leave the domain; calling it again does nothing."""
