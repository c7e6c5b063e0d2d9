"""Samples arrive once each, whatever is lost on the way."""

from __future__ import annotations

import random

import pytest

from golem.middleware.rtps.reliable import MAX_UNACKED, PATIENCE, Intake, Outbox
from golem.middleware.rtps.submessages import AckNack, Data, Gap, Heartbeat, message, parse

READER, WRITER = bytes.fromhex("00000104"), bytes.fromhex("00000203")
PREFIX = bytes(12)


def read(*parts: bytes) -> list[object]:
    return list(parse(message(PREFIX, b"", *parts), PREFIX)[2])


@pytest.mark.parametrize("loss", [0.0, 0.3, 0.7])
def test_every_sample_arrives_once_over_a_wire_that_loses(loss: float) -> None:
    rng = random.Random(1)
    outbox, intake = Outbox(WRITER, READER, patience=float("inf")), Intake(READER, WRITER)
    came: list[bytes] = []

    def wire(parts: list[bytes]) -> None:
        for part in read(*parts):
            if rng.random() < loss:
                continue
            if isinstance(part, Data) and intake.take(part.sequence):
                came.append(part.payload)
            elif isinstance(part, Heartbeat) and rng.random() >= loss:
                (ack,) = read(intake.heard(part))
                assert isinstance(ack, AckNack)
                wire(outbox.acknowledged(ack.base, ack.missing))

    sent = [b"\x00\x01\x00\x00" + bytes((i, 0, 0, 0)) for i in range(60)]
    for i, payload in enumerate(sent):
        wire(outbox.put(b"", payload, 0.01 * i))
    for i in range(400):
        wire(outbox.keep(1.0 + 0.2 * i))
    assert sorted(came) == sent
    assert outbox.keep(100.0) == []


def test_a_reader_that_never_answers_is_given_up() -> None:
    outbox = Outbox(WRITER, READER)
    for i in range(2 * MAX_UNACKED):
        outbox.put(b"", bytes((0, 1, 0, 0, i % 256)), 0.0)
    assert outbox.keep(1.0)
    outbox.keep(PATIENCE + 2.0)
    assert outbox.keep(PATIENCE + 3.0) == []


def test_what_will_not_come_is_not_asked_for() -> None:
    intake = Intake(READER, WRITER)
    intake.gone(Gap(PREFIX + WRITER, READER, 1, 4, (5,)))
    assert intake.take(4)
    (ack,) = read(intake.heard(Heartbeat(PREFIX + WRITER, READER, 1, 7)))
    assert isinstance(ack, AckNack) and (ack.base, ack.missing) == (6, (6, 7))


def test_a_late_reader_begins_where_the_writer_says() -> None:
    intake = Intake(READER, WRITER)
    intake.heard(Heartbeat(PREFIX + WRITER, READER, 900, 899))
    assert intake.take(900) and not intake.take(900) and not intake.take(899)
