"""What the transport inside one process promises beyond the contract: order without threads."""

from __future__ import annotations

import pytest

from golem.middleware.dds.base import ENCAPSULATION, Qos
from golem.middleware.dds.local import LocalDomain, LocalParticipant

TYPE = "std_msgs::msg::dds_::String_"
SAMPLE = ENCAPSULATION + b"text"


@pytest.fixture
def participant() -> LocalParticipant:
    return LocalDomain(clock=lambda: 12.5).participant()


def test_what_is_written_can_be_taken_at_once(participant: LocalParticipant) -> None:
    reader = participant.reader("rt/a", TYPE, Qos())
    writer = participant.writer("rt/a", TYPE, Qos())
    writer.write(SAMPLE)
    (got,) = reader.take()
    assert (got.payload, got.source_time, got.writer) == (SAMPLE, 12.5, writer.handle)


def test_callbacks_do_not_nest(participant: LocalParticipant) -> None:
    order: list[str] = []

    def on_request() -> None:
        requests.take()
        order.append("request in")
        replies_out.write(SAMPLE)
        order.append("request out")

    replies = participant.reader("rr/s", TYPE, Qos(), on_data=lambda: order.append(f"{len(replies.take())} reply"))
    replies_out = participant.writer("rr/s", TYPE, Qos())
    requests = participant.reader("rq/s", TYPE, Qos(), on_data=on_request)
    participant.writer("rq/s", TYPE, Qos()).write(SAMPLE)
    assert order == ["request in", "request out", "1 reply"]


def test_a_callback_that_takes_one_by_one_is_called_until_nothing_is_left(participant: LocalParticipant) -> None:
    taken: list[int] = []
    ready: list[bool] = []
    reader = participant.reader(
        "rt/a", TYPE, Qos(), on_data=lambda: taken.append(len(reader.take(1))) if ready else None
    )
    writer = participant.writer("rt/a", TYPE, Qos())
    for _ in range(3):
        writer.write(SAMPLE)
    ready.append(True)
    writer.write(SAMPLE)
    assert taken == [1, 1, 1, 1]


def test_a_callback_that_raises_does_not_silence_the_next(participant: LocalParticipant) -> None:
    calls: list[int] = []

    def on_data() -> None:
        calls.append(len(reader.take()))
        if len(calls) == 1:
            raise RuntimeError("first")

    reader = participant.reader("rt/a", TYPE, Qos(), on_data=on_data)
    writer = participant.writer("rt/a", TYPE, Qos())
    with pytest.raises(RuntimeError, match="first"):
        writer.write(SAMPLE)
    writer.write(SAMPLE)
    assert calls == [1, 1]
