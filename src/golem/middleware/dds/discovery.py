"""Who is on the domain, as Cyclone's discovery knows it at this moment."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from golem.middleware.dds.base import Qos
from golem.middleware.dds.library import Cyclone, EndpointData, ParticipantData, SampleInfo
from golem.middleware.dds.participant import CycloneParticipant, read_property, read_qos, read_user_data

_PSEUDO = 0x7FFF0000
"""DDS_MIN_PSEUDO_HANDLE: built-in topics are counted from here."""
_PARTICIPANTS, _WRITERS, _READERS = _PSEUDO + 1, _PSEUDO + 3, _PSEUDO + 4
_BATCH = 64


@dataclass(frozen=True, slots=True)
class Member:
    """A participant.

    Attributes:
        guid: 16 bytes.
        user_data: USER_DATA it announced, e.g. `"enclave=/;"` of ROS 2.
        process: name, number and machine of its process, as Cyclone tells them; empty for other libraries.
    """

    guid: bytes
    user_data: str
    process: str


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A writer or reader of somebody's.

    Attributes:
        qos: what it offers or requests.
        guid: 16 bytes.
        participant: guid of its participant.
        user_data: USER_DATA it announced, e.g. the type hash of ROS 2.
    """

    topic: str
    type_name: str
    qos: Qos
    guid: bytes
    participant: bytes
    user_data: str


def members(participant: CycloneParticipant) -> list[Member]:
    """Return every participant of the domain, `participant` among them."""

    def read(data: ParticipantData) -> Member:
        library = participant.library
        name, number, machine = (read_property(library, data.qos, k) for k in ("__ProcessName", "__Pid", "__Hostname"))
        process = f"{name} (process {number} on {machine})" if number else ""
        return Member(bytes(data.guid), read_user_data(library, data.qos), process)

    return _take(participant, _PARTICIPANTS, ParticipantData, read)


def others(participant: CycloneParticipant) -> list[Member]:
    """Return every participant of the domain but `participant`."""
    return [member for member in members(participant) if member.guid != participant.guid]


def writers(participant: CycloneParticipant) -> list[Endpoint]:
    """Return every writer of the domain, those of `participant` among them, of DDS itself none."""
    return _endpoints(participant, _WRITERS)


def readers(participant: CycloneParticipant) -> list[Endpoint]:
    """Return every reader of the domain, those of `participant` among them, of DDS itself none."""
    return _endpoints(participant, _READERS)


def _endpoints(participant: CycloneParticipant, topic: int) -> list[Endpoint]:
    found = _take(participant, topic, EndpointData, lambda data: _endpoint(participant.library, data))
    return [endpoint for endpoint in found if not endpoint.topic.startswith("DCPS")]


def _endpoint(library: Cyclone, data: EndpointData) -> Endpoint:
    topic, kind = (name.decode(errors="replace") for name in (data.topic, data.type_name))
    qos, user_data = read_qos(library, data.qos), read_user_data(library, data.qos)
    return Endpoint(topic, kind, qos, bytes(data.guid), bytes(data.participant_guid), user_data)


def _take(participant: CycloneParticipant, topic: int, kind: Any, read: Callable[[Any], Any]) -> list[Any]:
    """Return `read` of every sample of a built-in topic; a new reader of it sees the present state at once."""
    calls = participant.library.blocking
    found: list[Any] = []
    with _reader(participant, topic) as reader:
        while True:
            samples = (ctypes.c_void_p * _BATCH)()
            infos = (SampleInfo * _BATCH)()
            n = calls.dds_take(reader, samples, infos, _BATCH, _BATCH)
            participant.library.check(n, "Discovery cannot be read")
            for sample, info in zip(samples[:n], infos, strict=False):
                if info.valid and sample:
                    found.append(read(kind.from_address(sample)))
            if n == 0:
                return found
            calls.dds_return_loan(reader, samples, n)


@contextmanager
def _reader(participant: CycloneParticipant, topic: int) -> Iterator[int]:
    calls = participant.library.blocking
    entity = calls.dds_create_reader(participant.entity, topic, None, None)
    reader = participant.library.check(entity, "Discovery cannot be read")
    try:
        yield reader
    finally:
        calls.dds_delete(reader)
