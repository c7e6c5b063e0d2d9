"""What arrives together reaches the bus value by value."""

from __future__ import annotations

from golem.middleware.bus import Bus, News, Topic
from golem.runtime.live.stack_streams import OnePerTick

NUMBER = Topic("number", int)


def test_no_value_that_arrives_together_with_others_is_lost() -> None:
    bus = Bus()
    numbers, news = OnePerTick(bus, NUMBER, 3), News(bus, NUMBER)
    for number in (1, 2):
        numbers.take(number)
    read = []
    for tick in range(4):
        numbers.step(0.002 * tick)
        read.append(news.read())
    assert read == [1, 2, None, None]


def test_of_too_many_the_oldest_are_dropped() -> None:
    bus = Bus()
    numbers = OnePerTick(bus, NUMBER, 3)
    for number in range(10):
        numbers.take(number)
    numbers.step(0.0)
    assert bus.latest(NUMBER) == 7
