"""The transport contract, on the transport inside one process and on Cyclone alike."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator

import pytest

from golem.middleware.dds.base import ENCAPSULATION, LATCHED, SENSOR, DdsError, Participant, Qos, Reader, Sample, Writer
from golem.middleware.dds.local import LocalDomain

Pair = tuple[Participant, Participant]
TYPE = "std_msgs::msg::dds_::String_"


@pytest.fixture(params=["local", "cyclone"])
def pair(request: pytest.FixtureRequest, domain: int) -> Iterator[Pair]:
    if request.param == "local":
        shared = LocalDomain()
        members: Pair = shared.participant(), shared.participant()
    else:
        pytest.importorskip("cyclonedds")
        from golem.middleware.dds.connect import connect
        from golem.middleware.dds.domain import DdsConfig

        members = connect(DdsConfig(domain)), connect(DdsConfig(domain))
    yield members
    for member in members:
        member.close()


def sample(text: str) -> bytes:
    return ENCAPSULATION + text.encode()


def eventually(condition: Callable[[], object]) -> None:
    end = time.monotonic() + 5.0
    while not condition():
        assert time.monotonic() < end, "it did not happen in time"
        time.sleep(0.002)


def receive(reader: Reader, n: int) -> list[Sample]:
    got: list[Sample] = []
    eventually(lambda: got.extend(reader.take()) or len(got) >= n)
    return got


def texts(samples: list[Sample]) -> list[str]:
    return [s.payload[4:].decode().rstrip("\0") for s in samples if s.alive]


def connected(pair: Pair, offered: Qos, requested: Qos) -> tuple[Writer, Reader]:
    writer, reader = pair[0].writer("rt/a", TYPE, offered), pair[1].reader("rt/a", TYPE, requested)
    eventually(lambda: writer.matched() and reader.matched())
    return writer, reader


def test_a_sample_arrives_once_with_its_writer_and_time(pair: Pair) -> None:
    writer, reader = connected(pair, Qos(), Qos())
    buffer = bytearray(sample("x"))
    before = time.time()
    writer.write(memoryview(buffer))
    buffer[4:] = b"y"
    (got,) = receive(reader, 1)
    assert texts([got]) == ["x"] and got.payload[:4] == ENCAPSULATION and got.alive
    assert before - 0.001 <= got.source_time <= time.time() + 0.001
    assert reader.writers() == {got.writer: writer.guid}
    assert reader.take() == []
    guids = {pair[0].guid, pair[1].guid, writer.guid, reader.guid}
    assert len(guids) == 4 and all(len(guid) == 16 for guid in guids)


@pytest.mark.parametrize("size", [1, 2, 3, 4, 7, 2088, 200_001])
def test_payloads_of_every_size_arrive_whole(pair: Pair, size: int) -> None:
    writer, reader = connected(pair, Qos(), Qos())
    payload = ENCAPSULATION + bytes(i * 7 % 256 for i in range(size))
    writer.write(payload)
    (got,) = receive(reader, 1)
    assert got.payload[: len(payload)] == payload
    assert not any(got.payload[len(payload) :]) and len(got.payload) - len(payload) < 4


@pytest.mark.parametrize(
    ("topic", "type_name", "offered", "requested", "match"),
    [
        ("rt/a", TYPE, Qos(), SENSOR, True),
        ("rt/a", TYPE, SENSOR, Qos(), False),
        ("rt/a", TYPE, Qos(), LATCHED, False),
        ("rt/a", TYPE, LATCHED, Qos(), True),
        ("rt/b", TYPE, Qos(), Qos(), False),
        ("rt/a", "other", Qos(), Qos(), False),
    ],
)
def test_matching_is_by_topic_type_and_qos(
    pair: Pair, topic: str, type_name: str, offered: Qos, requested: Qos, match: bool
) -> None:
    writer, reader = pair[0].writer("rt/a", TYPE, offered), pair[1].reader(topic, type_name, requested)
    if match:
        eventually(lambda: writer.matched() == reader.matched() == 1)
    else:
        time.sleep(0.05)
        assert writer.matched() == reader.matched() == 0


def test_a_late_reader_gets_the_history_it_asks_for(pair: Pair) -> None:
    writer = pair[0].writer("rt/a", TYPE, Qos(transient_local=True, depth=2))
    for text in "abc":
        writer.write(sample(text))
    latched = pair[1].reader("rt/a", TYPE, Qos(transient_local=True, depth=None))
    assert texts(receive(latched, 2)) == ["b", "c"]
    assert pair[1].reader("rt/a", TYPE, Qos()).take() == []


@pytest.mark.parametrize(("depth", "kept"), [(2, ["b", "c"]), (None, ["a", "b", "c"])])
def test_a_reader_keeps_its_newest_samples(pair: Pair, depth: int | None, kept: list[str]) -> None:
    writer, reader = connected(pair, Qos(), Qos(depth=depth))
    _, witness = connected(pair, Qos(), Qos(depth=None))
    for text in "abc":
        writer.write(sample(text))
    receive(witness, 3)
    eventually(lambda: reader.matched())
    assert texts(receive(reader, len(kept))) == kept


def test_take_gives_no_more_than_asked(pair: Pair) -> None:
    writer, reader = connected(pair, Qos(depth=None), Qos(depth=None))
    _, witness = connected(pair, Qos(), Qos(depth=None))
    for i in range(200):
        writer.write(sample(str(i)))
    receive(witness, 200)
    first = reader.take(150)
    rest = reader.take(150)
    assert (len(first), len(rest)) == (150, 50)
    assert texts(first + rest) == [str(i) for i in range(200)]


def test_a_request_is_answered_from_its_callback(pair: Pair) -> None:
    order: list[str] = []

    def on_request() -> None:
        order.append("request in")
        for got in requests.take():
            if got.alive:
                replies_out.write(got.payload)
        time.sleep(0.01)
        order.append("request out")

    replies_out = pair[1].writer("rr/s", TYPE, Qos())
    requests = pair[1].reader("rq/s", TYPE, Qos(), on_data=on_request)
    replies = pair[1].reader("rr/s", TYPE, Qos(), on_data=lambda: order.extend(texts(replies.take())))
    requests_out = pair[0].writer("rq/s", TYPE, Qos())
    eventually(lambda: requests_out.matched() and replies.matched())
    requests_out.write(sample("reply"))
    eventually(lambda: "reply" in order)
    assert order == ["request in", "request out", "reply"]


def test_a_callback_runs_until_everything_is_taken(pair: Pair) -> None:
    got: list[Sample] = []
    done = threading.Event()

    def on_data() -> None:
        got.extend(reader.take(3))
        if len(texts(got)) == 100:
            done.set()

    reader = pair[1].reader("rt/a", TYPE, Qos(depth=None), on_data=on_data)
    writer = pair[0].writer("rt/a", TYPE, Qos(depth=None))
    eventually(lambda: writer.matched())
    for i in range(100):
        writer.write(sample(str(i)))
    assert done.wait(5.0)
    assert texts(got) == [str(i) for i in range(100)]


def test_the_last_writer_to_leave_is_noticed_once(pair: Pair) -> None:
    reader = pair[1].reader("rt/a", TYPE, Qos())
    first, second = (pair[0].writer("rt/a", TYPE, Qos()) for _ in range(2))
    eventually(lambda: reader.matched() == 2)
    first.write(sample("x"))
    second.write(sample("y"))
    first.close()
    assert [s.alive for s in receive(reader, 2)] == [True, True]
    eventually(lambda: reader.matched() == 1)
    assert reader.take() == []
    second.close()
    assert [(s.alive, s.payload) for s in receive(reader, 1)] == [(False, b"")]
    assert reader.matched() == 0


def test_errors_are_sentences(pair: Pair) -> None:
    writer, reader = connected(pair, Qos(), Qos())
    with pytest.raises(DdsError, match="cannot carry 'other' too"):
        pair[0].reader("rt/a", "other", Qos())
    for wrong in (b"", ENCAPSULATION, b"\x00\x07\x00\x00abcd", b"abcdefgh"):
        with pytest.raises(DdsError, match="CDR header"):
            writer.write(wrong)
    pair[0].close()
    pair[0].close()
    reader.close()
    with pytest.raises(DdsError, match="writer of 'rt/a' is closed"):
        writer.write(sample("x"))
    with pytest.raises(DdsError, match="reader of 'rt/a' is closed"):
        reader.take()
    with pytest.raises(DdsError, match="participant is closed"):
        pair[0].writer("rt/a", TYPE, Qos())


def test_a_history_has_room_for_a_sample() -> None:
    with pytest.raises(ValueError, match="at least one"):
        Qos(depth=0)
