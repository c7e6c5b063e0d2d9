import pytest

from golem.middleware.dds.base import ENCAPSULATION, LATCHED, SENSOR, DdsError, Qos, Reader
from golem.middleware.dds.local import LocalDomain, LocalParticipant

Pair = tuple[LocalParticipant, LocalParticipant]
TYPE = "std_msgs::msg::dds_::String_"


def sample(text: str) -> bytes:
    return ENCAPSULATION + text.encode()


def texts(reader: Reader) -> list[str]:
    return [bytes(s.payload[4:]).decode() for s in reader.take() if s.alive]


@pytest.fixture
def pair() -> Pair:
    domain = LocalDomain(clock=lambda: 12.5)
    return domain.participant(), domain.participant()


def test_a_sample_arrives_once_with_its_writer_and_time(pair: Pair) -> None:
    reader = pair[1].reader("rt/a", TYPE, Qos())
    writer = pair[0].writer("rt/a", TYPE, Qos())
    buffer = bytearray(sample("x"))
    writer.write(buffer)
    buffer[4:] = b"y"
    (got,) = reader.take()
    assert (bytes(got.payload), got.source_time, got.writer, got.alive) == (
        sample("x"),
        12.5,
        writer.handle,
        True,
    )
    assert reader.take() == []
    assert reader.writers() == {writer.handle: writer.guid}
    assert writer.readers() == {reader.handle: reader.guid}


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
    writer.write(sample("x"))
    assert (writer.matched(), reader.matched(), len(reader.take())) == (match, match, match)


def test_a_late_reader_gets_the_history_it_asks_for(pair: Pair) -> None:
    writer = pair[0].writer("rt/a", TYPE, Qos(transient_local=True, depth=2))
    for text in "abc":
        writer.write(sample(text))
    latched = pair[1].reader("rt/a", TYPE, Qos(transient_local=True, depth=None))
    assert texts(latched) == ["b", "c"]
    assert texts(pair[1].reader("rt/a", TYPE, Qos())) == []


@pytest.mark.parametrize(("depth", "kept"), [(2, ["b", "c"]), (None, ["a", "b", "c"])])
def test_a_reader_keeps_its_newest_samples(pair: Pair, depth: int | None, kept: list[str]) -> None:
    reader = pair[1].reader("rt/a", TYPE, Qos(depth=depth))
    writer = pair[0].writer("rt/a", TYPE, Qos())
    for text in "abc":
        writer.write(sample(text))
    assert texts(reader) == kept


def test_callbacks_do_not_nest(pair: Pair) -> None:
    order: list[str] = []

    def on_request() -> None:
        requests.take()
        order.append("request in")
        replies_out.write(sample("reply"))
        order.append("request out")

    replies = pair[0].reader("rr/s", TYPE, Qos(), on_data=lambda: order.append(f"reply {texts(replies)}"))
    replies_out = pair[1].writer("rr/s", TYPE, Qos())
    requests = pair[1].reader("rq/s", TYPE, Qos(), on_data=on_request)
    pair[0].writer("rq/s", TYPE, Qos()).write(sample("request"))
    assert order == ["request in", "request out", "reply ['reply']"]


def test_a_callback_that_raises_does_not_silence_the_next(pair: Pair) -> None:
    calls: list[int] = []

    def on_data() -> None:
        calls.append(len(reader.take()))
        if len(calls) == 1:
            raise RuntimeError("first")

    reader = pair[1].reader("rt/a", TYPE, Qos(), on_data=on_data)
    writer = pair[0].writer("rt/a", TYPE, Qos())
    with pytest.raises(RuntimeError, match="first"):
        writer.write(sample("x"))
    writer.write(sample("y"))
    assert calls == [1, 1]


def test_the_last_writer_to_leave_is_noticed_once(pair: Pair) -> None:
    reader = pair[1].reader("rt/a", TYPE, Qos())
    first, second = (pair[0].writer("rt/a", TYPE, Qos()) for _ in range(2))
    first.write(sample("x"))
    first.close()
    assert [s.alive for s in reader.take()] == [True]
    second.close()
    assert [(s.alive, bytes(s.payload)) for s in reader.take()] == [(False, b"")]
    pair[0].close()
    assert reader.take() == [] and reader.matched() == 0


def test_errors_are_sentences(pair: Pair) -> None:
    writer = pair[0].writer("rt/a", TYPE, Qos())
    with pytest.raises(DdsError, match="cannot carry 'other' too"):
        pair[0].reader("rt/a", "other", Qos())
    with pytest.raises(DdsError, match="CDR header"):
        writer.write(b"\x00")
    pair[0].close()
    pair[0].close()
    with pytest.raises(DdsError, match="closed"):
        writer.write(sample("x"))
    with pytest.raises(DdsError, match="closed"):
        pair[0].writer("rt/a", TYPE, Qos())
