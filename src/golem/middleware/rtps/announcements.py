"""What participants and their endpoints tell each other of themselves: the payloads of SPDP and SEDP.

Source: DDSI-RTPS 2.5, 8.5 and 9.6.3; the builtin entities' ids are those of its table 9.2.
"""

from __future__ import annotations

import socket
import struct
from dataclasses import dataclass

from golem.middleware.rtps.submessages import NO_VENDOR, VERSION, Data, parameter_list, parameters

PARTICIPANT = bytes.fromhex("000001c1")
SPDP_WRITER, SPDP_READER = bytes.fromhex("000100c2"), bytes.fromhex("000100c7")
WRITERS_WRITER, WRITERS_READER = bytes.fromhex("000003c2"), bytes.fromhex("000003c7")
READERS_WRITER, READERS_READER = bytes.fromhex("000004c2"), bytes.fromhex("000004c7")
"""Builtin endpoints: of participants, of what tells of writers, and of what tells of readers."""
KEYLESS_WRITER, KEYLESS_READER = 0x03, 0x04
"""Kinds of user entities, the last byte of their ids."""

_PARAMETERS = b"\x00\x03\x00\x00"
"""Encapsulation of a little-endian list of parameters."""
_ENDPOINT_SET = 0x01 | 0x02 | 0x04 | 0x08 | 0x10
"""We announce and detect participants, announce writers and readers, and detect writers."""
_LEASE, _TOPIC, _TYPE, _VERSION, _VENDOR, _RELIABILITY, _DURABILITY = 0x02, 0x05, 0x07, 0x15, 0x16, 0x1A, 0x1D
_USER_DATA, _DEFAULT_UNICAST, _METATRAFFIC_UNICAST = 0x2C, 0x31, 0x32
_PARTICIPANT_GUID, _BUILTIN_ENDPOINTS, _ENDPOINT_GUID = 0x50, 0x58, 0x5A
_UDP_V4 = 1
_RELIABLE = struct.pack("<IiI", 2, 0, round(0.1 * 2**32))
_BEST_EFFORT = struct.pack("<IiI", 1, 0, round(0.1 * 2**32))
_VOLATILE = struct.pack("<I", 0)


@dataclass(frozen=True, slots=True)
class Announced:
    """Another participant: where it takes discovery, where it takes data (UDP ports), for how long it is there [s]."""

    metatraffic: int
    data: int
    lease: float


def own_participant(prefix: bytes, address: str, port: int, lease: float) -> bytes:
    """Return what we say of ourselves, who take everything at one port of `address`."""
    locator = struct.pack("<iI12x4s", _UDP_V4, port, socket.inet_aton(address))
    return _PARAMETERS + parameter_list(
        [
            (_VERSION, VERSION),
            (_VENDOR, NO_VENDOR),
            (_PARTICIPANT_GUID, prefix + PARTICIPANT),
            (_METATRAFFIC_UNICAST, locator),
            (_DEFAULT_UNICAST, locator),
            (_LEASE, struct.pack("<iI", int(lease), 0)),
            (_BUILTIN_ENDPOINTS, struct.pack("<I", _ENDPOINT_SET)),
        ]
    )


def own_endpoint(guid: bytes, topic: str, type_name: str, user_data: str, reliable: bool = True) -> bytes:
    """Return what we say of a volatile endpoint of ours."""
    data = user_data.encode()
    return _PARAMETERS + parameter_list(
        [
            (_VERSION, VERSION),
            (_VENDOR, NO_VENDOR),
            (_PARTICIPANT_GUID, guid[:12] + PARTICIPANT),
            (_ENDPOINT_GUID, guid),
            (_TOPIC, _string(topic)),
            (_TYPE, _string(type_name)),
            (_RELIABILITY, _RELIABLE if reliable else _BEST_EFFORT),
            (_DURABILITY, _VOLATILE),
            (_USER_DATA, struct.pack("<I", len(data)) + data),
        ]
    )


def participant(sample: Data) -> Announced:
    """Return what a participant says of itself. Raises ValueError: it does not say where it is."""
    ports: dict[int, int] = {}
    lease = 20.0
    for pid, value, order in _read(sample.payload):
        if pid in (_METATRAFFIC_UNICAST, _DEFAULT_UNICAST):
            kind, port = struct.unpack_from(f"{order}iI", value)
            if kind == _UDP_V4 and 0 < port < 65536:
                ports.setdefault(pid, port)
        elif pid == _LEASE:
            seconds, _ = struct.unpack_from(f"{order}iI", value)
            lease = float(max(1, seconds))
    if _METATRAFFIC_UNICAST not in ports or _DEFAULT_UNICAST not in ports:
        raise ValueError("a participant without a UDP port")
    return Announced(ports[_METATRAFFIC_UNICAST], ports[_DEFAULT_UNICAST], lease)


def endpoint(sample: Data) -> tuple[bytes, str]:
    """Return guid and topic of an endpoint of another participant. Raises ValueError: it lacks one of them."""
    guid, topic = b"", ""
    for pid, value, order in _read(sample.payload):
        if pid == _ENDPOINT_GUID:
            guid = value[:16]
        elif pid == _TOPIC:
            (size,) = struct.unpack_from(f"{order}I", value)
            topic = value[4 : 4 + size].split(b"\0")[0].decode(errors="replace")
    if len(guid) < 16 or not topic:
        raise ValueError("an endpoint without guid or topic")
    return guid, topic


def _read(payload: bytes) -> list[tuple[int, bytes, str]]:
    if len(payload) < 4:
        raise ValueError("an announcement without encapsulation")
    order = "<" if payload[1] & 1 else ">"
    try:
        return [(pid, value, order) for pid, value in parameters(payload, 4, order)[0]]
    except struct.error as error:
        raise ValueError("an announcement ends early") from error


def _string(text: str) -> bytes:
    data = text.encode() + b"\0"
    return struct.pack("<I", len(data)) + data
