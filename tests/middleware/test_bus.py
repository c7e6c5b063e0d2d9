"""The bus: newest value, in order, when it is due, of the type the topic carries."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.middleware.bus import Bus, News, Topic, WrongType
from golem.types import TICK

X, Y, WORDS = Topic("x", int), Topic("y", int), Topic("words", str)


def test_a_stream_nobody_wrote_is_none() -> None:
    bus = Bus()
    assert bus.latest(X) is None
    assert bus.count(X) == 0
    assert bus.topics() == {}


def test_without_latency_a_value_is_there_at_once() -> None:
    bus = Bus()
    bus.publish(X, 1, t=0.0)
    bus.publish(X, 2, t=0.0)
    assert (bus.latest(X), bus.count(X)) == (2, 2)


def test_a_late_value_is_there_when_it_is_due_and_not_before() -> None:
    bus = Bus()
    bus.publish(X, 1, t=1.0, latency=0.033)
    bus.deliver(1.032)
    assert (bus.latest(X), bus.count(X)) == (None, 0)
    bus.deliver(1.034)
    assert (bus.latest(X), bus.count(X)) == (1, 1)
    bus.deliver(2.0)
    assert bus.count(X) == 1


def test_a_latency_of_whole_ticks_is_exact_over_an_hour() -> None:
    bus = Bus()
    for tick in (0, 1, 3, 1_000, 1_799_999):
        bus.publish(X, tick, t=tick * TICK, latency=7 * TICK)
        bus.deliver((tick + 6) * TICK)
        assert bus.latest(X) != tick
        bus.deliver((tick + 7) * TICK)
        assert bus.latest(X) == tick


def test_a_prompt_value_does_not_overtake_a_late_one() -> None:
    bus = Bus()
    bus.publish(WORDS, "late", t=0.0, latency=0.1)
    bus.publish(WORDS, "prompt", t=0.01)
    assert bus.latest(WORDS) is None
    bus.deliver(0.05)
    assert bus.latest(WORDS) is None
    bus.deliver(0.1)
    assert (bus.latest(WORDS), bus.count(WORDS)) == ("prompt", 2)


@given(st.lists(st.floats(0.0, 0.05), min_size=1, max_size=30))
def test_values_arrive_in_the_order_they_were_published(latencies: list[float]) -> None:
    bus = Bus()
    seen: list[int] = []
    for tick in range(len(latencies) + 40):
        t = tick * TICK
        bus.deliver(t)
        if tick < len(latencies):
            bus.publish(X, tick, t, latencies[tick])
        value = bus.latest(X)
        if value is not None:
            seen.append(value)
    assert seen == sorted(seen)
    assert (seen[-1], bus.count(X)) == (len(latencies) - 1, len(latencies))


def test_what_is_withdrawn_does_not_arrive_and_what_comes_next_is_prompt() -> None:
    bus = Bus()
    bus.publish(X, 1, 0.0)
    bus.publish(X, 2, 0.0, latency=0.1)
    bus.withdraw(X)
    bus.deliver(1.0)
    assert bus.latest(X) == 1
    bus.publish(X, 3, 1.0)
    assert (bus.latest(X), bus.count(X)) == (3, 2)


def test_streams_do_not_wait_for_each_other() -> None:
    bus = Bus()
    bus.publish(X, 1, t=0.0, latency=1.0)
    bus.publish(Y, 2, t=0.0)
    assert (bus.latest(X), bus.latest(Y)) == (None, 2)


def test_a_value_of_another_type_is_refused_and_both_are_named() -> None:
    with pytest.raises(WrongType, match="Topic 'x' carries int, not str"):
        Bus().publish(X, "1", t=0.0)  # type: ignore[type-var]


def test_topics_name_what_was_delivered_and_its_type() -> None:
    bus = Bus()
    bus.publish(X, 1, t=0.0)
    bus.publish(WORDS, "s", t=0.0)
    bus.publish(Y, 1, t=0.0, latency=1.0)
    assert bus.topics() == {"words": "str", "x": "int"}
    assert list(bus.topics()) == ["words", "x"]


def test_news_gives_each_value_once_and_begins_now() -> None:
    bus = Bus()
    bus.publish(X, 1, 0.0)
    news = News(bus, X)
    assert news.read() is None
    bus.publish(X, 2, 0.1)
    bus.publish(X, 3, 0.1)
    assert (news.read(), news.read()) == (3, None)


def test_a_cleared_bus_holds_nothing_but_still_tells_new_from_old() -> None:
    bus = Bus()
    bus.publish(X, 1, 0.0)
    bus.publish(X, 2, 0.0, latency=1.0)
    news = News(bus, X)
    bus.clear()
    bus.deliver(5.0)
    assert bus.latest(X) is None and bus.topics() == {} and news.read() is None
    bus.publish(X, 3, 0.0)
    assert bus.count(X) == 2 and news.read() == 3
