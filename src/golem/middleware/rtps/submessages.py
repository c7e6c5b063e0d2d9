"""The messages of RTPS that this package sends and understands, as bytes and back.

Layouts: DDSI-RTPS 2.5, 9.4 (submessages) and 9.6 (parameters). What is sent is little-endian; what comes may be either.
Ids of entities are 4 bytes and guids 16, as on the wire; sequence numbers are counted from 1.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

HEADER = struct.Struct("<4s2s2s12s")
VERSION = b"\x02\x03"
NO_VENDOR = b"\x00\x00"
FAST_DDS = b"\x01\x0f"
"""Vendor ids; the first two bytes of the guids of a vendor's entities, too."""
ANY_ENTITY = bytes(4)
ACK_NACK, HEARTBEAT, GAP, INFO_TS, INFO_DESTINATION, DATA = 0x06, 0x07, 0x08, 0x09, 0x0E, 0x15
LITTLE, INLINE_QOS, FINAL, PAYLOAD = 0x01, 0x02, 0x02, 0x04
"""Flags of submessages."""
SENTINEL, KEY_HASH, STATUS_INFO, RELATED_SAMPLE = 0x01, 0x70, 0x71, 0x83
"""Parameters of inline QoS."""
DISPOSED = 3
"""Status of what has been disposed of and unregistered."""
MAX_SET = 256
"""Numbers that one set of sequence numbers spans at most."""


@dataclass(frozen=True, slots=True)
class Data:
    """A sample.

    Attributes:
        writer: guid.
        reader_id: of whom it is for, or `ANY_ENTITY`.
        sequence: its number.
        related: what it answers, or whom to answer, as a guid and a number; None where it does not say.
        disposed: whether it says that something is there no more.
        key: guid of that something.
        payload: CDR with its encapsulation header, or empty.
    """

    writer: bytes
    reader_id: bytes
    sequence: int
    related: tuple[bytes, int] | None
    disposed: bool
    key: bytes
    payload: bytes


@dataclass(frozen=True, slots=True)
class Heartbeat:
    """What a writer has: the samples from `first` to `last`, which is before `first` if it has none."""

    writer: bytes
    reader_id: bytes
    first: int
    last: int


@dataclass(frozen=True, slots=True)
class Gap:
    """What a writer will never send: the samples from `start` to before `base`, and `more` behind it."""

    writer: bytes
    reader_id: bytes
    start: int
    base: int
    more: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AckNack:
    """What a reader has, all before `base`, and what it misses."""

    reader: bytes
    writer_id: bytes
    base: int
    missing: tuple[int, ...]


Submessage = Data | Heartbeat | Gap | AckNack


def parse(datagram: bytes, own: bytes) -> tuple[bytes, bytes, list[Submessage]]:
    """Return vendor id, guid prefix (12 bytes) and content of a datagram, less what is for other prefixes than `own`.

    Raises ValueError: it is no RTPS message, or a malformed one.
    """
    try:
        magic, version, vendor, prefix = HEADER.unpack_from(datagram)
        if magic != b"RTPS" or version[0] != VERSION[0]:
            raise ValueError("this is no message of RTPS 2")
        return vendor, prefix, list(_submessages(datagram, prefix, own))
    except struct.error as error:
        raise ValueError("a message of RTPS ends early") from error


def _submessages(datagram: bytes, prefix: bytes, own: bytes) -> Iterator[Submessage]:
    position, for_us = HEADER.size, True
    while position + 4 <= len(datagram):
        kind, flags = datagram[position : position + 2]
        order = "<" if flags & LITTLE else ">"
        (length,) = struct.unpack_from(f"{order}H", datagram, position + 2)
        start = position + 4
        end = start + length if length or kind == INFO_TS else len(datagram)
        if end > len(datagram):
            raise ValueError("a submessage of RTPS ends early")
        body = datagram[start:end]
        if kind == INFO_DESTINATION:
            for_us = body[:12] in (own, bytes(12))
        elif for_us and kind == DATA:
            yield _data(body, flags, order, prefix)
        elif for_us and kind == HEARTBEAT:
            reader, writer = body[:4], body[4:8]
            first, last = (_number(order, body, at) for at in (8, 16))
            yield Heartbeat(prefix + writer, reader, first, last)
        elif for_us and kind == GAP:
            base, more = _number_set(order, body, 16)
            yield Gap(prefix + body[4:8], body[:4], _number(order, body, 8), base, more)
        elif for_us and kind == ACK_NACK:
            base, missing = _number_set(order, body, 8)
            yield AckNack(prefix + body[:4], body[4:8], base, missing)
        position = end


def _data(body: bytes, flags: int, order: str, prefix: bytes) -> Data:
    to_qos, reader, writer = struct.unpack_from(f"{order}2xH4s4s", body)
    sequence, at = _number(order, body, 12), 4 + to_qos
    related, status, key = None, 0, b""
    if flags & INLINE_QOS:
        found, at = parameters(body, at, order)
        for pid, value in found:
            if pid == RELATED_SAMPLE:
                related = value[:16], _number(order, value, 16)
            elif pid == STATUS_INFO:
                (status,) = struct.unpack_from(">I", value)
            elif pid == KEY_HASH:
                key = value[:16]
    payload = body[at:] if flags & PAYLOAD else b""
    return Data(prefix + writer, reader, sequence, related, bool(status & DISPOSED), key, payload)


def parameters(data: bytes, at: int, order: str) -> tuple[list[tuple[int, bytes]], int]:
    """Return ids and values of the parameters from `at` on, and their end. Raises ValueError, struct.error: no end."""
    found: list[tuple[int, bytes]] = []
    while True:
        pid, length = struct.unpack_from(f"{order}HH", data, at)
        at += 4
        if pid == SENTINEL:
            return found, at
        if at + length > len(data):
            raise ValueError("a parameter of RTPS ends early")
        found.append((pid, data[at : at + length]))
        at += length


def parameter_list(found: Iterable[tuple[int, bytes]]) -> bytes:
    """Return a list of parameters, little-endian; the inverse of `parameters`."""
    parts: list[bytes] = []
    for pid, value in found:
        padded = value + bytes(-len(value) % 4)
        parts += [struct.pack("<HH", pid, len(padded)), padded]
    return b"".join((*parts, struct.pack("<HH", SENTINEL, 0)))


def _number(order: str, data: bytes, at: int) -> int:
    high, low = struct.unpack_from(f"{order}iI", data, at)
    return (high << 32) + low


def _number_set(order: str, data: bytes, at: int) -> tuple[int, tuple[int, ...]]:
    base = _number(order, data, at)
    (size,) = struct.unpack_from(f"{order}I", data, at + 8)
    if size > MAX_SET:
        raise ValueError("a set of sequence numbers is too large")
    words = struct.unpack_from(f"{order}{(size + 31) // 32}I", data, at + 12)
    return base, tuple(base + i for i in range(size) if words[i // 32] >> (31 - i % 32) & 1)


def message(prefix: bytes, to: bytes, *submessages: bytes) -> bytes:
    """Return a datagram from `prefix`; `to` is the prefix of who shall read it, or nothing for everybody."""
    destination = (_submessage(INFO_DESTINATION, 0, to),) if to else ()
    return b"".join((HEADER.pack(b"RTPS", VERSION, NO_VENDOR, prefix), *destination, *submessages))


def data(writer_id: bytes, reader_id: bytes, sequence: int, qos: bytes, payload: bytes) -> bytes:
    """Return the submessage of a sample; `qos` is a list of parameters or empty, so is `payload`."""
    flags = (INLINE_QOS if qos else 0) | (PAYLOAD if payload else 0)
    body = struct.pack("<HH4s4s", 0, 16, reader_id, writer_id) + _pack(sequence) + qos + payload
    return _submessage(DATA, flags, body)


def heartbeat(writer_id: bytes, reader_id: bytes, first: int, last: int, count: int) -> bytes:
    """Return the submessage of a heartbeat that wants an answer."""
    body = reader_id + writer_id + _pack(first) + _pack(last) + struct.pack("<I", count & 0xFFFFFFFF)
    return _submessage(HEARTBEAT, 0, body)


def ack_nack(reader_id: bytes, writer_id: bytes, base: int, missing: Iterable[int], count: int) -> bytes:
    """Return the submessage of an acknowledgement; `missing` are numbers from `base` to before `base + MAX_SET`."""
    offsets = [number - base for number in missing]
    size = max(offsets, default=-1) + 1
    words = [0] * ((size + 31) // 32)
    for offset in offsets:
        words[offset // 32] |= 1 << (31 - offset % 32)
    numbers = _pack(base) + struct.pack(f"<I{len(words)}I", size, *words)
    body = reader_id + writer_id + numbers + struct.pack("<I", count & 0xFFFFFFFF)
    return _submessage(ACK_NACK, FINAL, body)


def related_sample(guid: bytes, sequence: int) -> bytes:
    """Return the inline QoS that says what a sample answers."""
    return parameter_list([(RELATED_SAMPLE, guid + _pack(sequence))])


def _pack(sequence: int) -> bytes:
    return struct.pack("<iI", sequence >> 32, sequence & 0xFFFFFFFF)


def _submessage(kind: int, flags: int, body: bytes) -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack("<BBH", kind, flags | LITTLE, len(body)) + body
