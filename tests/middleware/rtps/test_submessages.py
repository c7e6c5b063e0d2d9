"""Messages of RTPS are read as they were written, and bytes that are none raise nothing but ValueError."""

from __future__ import annotations

import random
import struct

import pytest

from golem.middleware.rtps import submessages
from golem.middleware.rtps.submessages import AckNack, Data, Gap, Heartbeat, parse

OWN, PEER = bytes(range(12)), bytes(range(100, 112))
READER, WRITER = bytes.fromhex("00000104"), bytes.fromhex("00000203")
CLIENT = bytes(range(50, 66))
PAYLOAD = b"\x00\x01\x00\x00\x2a\x00\x00\x00"


def sent(*parts: bytes, to: bytes = OWN) -> list[submessages.Submessage]:
    return parse(submessages.message(PEER, to, *parts), OWN)[2]


def test_a_sample_is_read_as_it_was_written() -> None:
    qos = submessages.related_sample(CLIENT, (3 << 32) + 7)
    (found,) = sent(submessages.data(WRITER, READER, 1 << 40, qos, PAYLOAD))
    expected = Data(PEER + WRITER, READER, 1 << 40, (CLIENT, (3 << 32) + 7), False, b"", PAYLOAD)
    assert found == expected


def test_heartbeats_and_acknowledgements_are_read_as_they_were_written() -> None:
    missing = (5, 36, 37, 260)
    beat, ack = sent(
        submessages.heartbeat(WRITER, READER, 5, 260, 9), submessages.ack_nack(READER, WRITER, 5, missing, 2)
    )
    assert beat == Heartbeat(PEER + WRITER, READER, 5, 260)
    assert ack == AckNack(PEER + READER, WRITER, 5, missing)


def test_a_gap_of_the_other_byte_order_is_understood() -> None:
    body = READER + WRITER + struct.pack(">iIiIII", 0, 3, 0, 6, 4, 0b1010 << 28)
    (gap,) = sent(struct.pack(">BBH", submessages.GAP, 0, len(body)) + body)
    assert gap == Gap(PEER + WRITER, READER, 3, 6, (6, 8))


def test_what_is_for_others_is_left_out() -> None:
    assert sent(submessages.heartbeat(WRITER, READER, 1, 2, 1), to=CLIENT[:12]) == []
    assert len(sent(submessages.heartbeat(WRITER, READER, 1, 2, 1), to=b"")) == 1


@pytest.mark.parametrize("seed", range(20))
def test_mutilated_messages_raise_nothing_else(seed: int) -> None:
    rng = random.Random(seed)
    qos = submessages.related_sample(CLIENT, 7)
    whole = submessages.message(
        PEER,
        OWN,
        submessages.data(WRITER, READER, 1, qos, PAYLOAD),
        submessages.ack_nack(READER, WRITER, 5, (6, 70), 2),
        submessages.heartbeat(WRITER, READER, 1, 2, 1),
    )
    for _ in range(500):
        data = bytearray(whole[: rng.randint(0, len(whole))] if rng.random() < 0.3 else whole)
        for _ in range(rng.randint(0, 8) if data else 0):
            data[rng.randrange(len(data))] = rng.randrange(256)
        try:
            parse(bytes(data), OWN)
        except ValueError:
            pass
