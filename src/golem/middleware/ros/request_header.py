"""The header that pairs replies with requests where services run over Cyclone DDS.

A payload is CDR of the header followed by the body: the 64-bit handle of the client's request writer and a 64-bit
sequence number, echoed by the reply (`cdds_request_header`, ros2/rmw_cyclonedds, serdata.hpp).
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from golem.middleware.dds.base import Payload
from golem.middleware.ros.message import CodecError


class Header(NamedTuple):
    """Pairs a reply with its request.

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
    """Return header and body of a payload; the inverse of `pack`.

    Raises:
        CodecError: it is too short.
    """
    if len(payload) < 20:
        raise CodecError(f"A service payload has at least 20 bytes, not {len(payload)}.")
    order = "<" if payload[1] & 1 else ">"
    return Header(*struct.unpack_from(f"{order}Qq", payload, 4)), b"".join((payload[:4], payload[20:]))
