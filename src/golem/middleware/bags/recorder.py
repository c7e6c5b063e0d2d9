"""Takes messages off a domain as they are and hands them to a sink: nothing is decoded but the time on /clock."""

from __future__ import annotations

import re
import struct
import threading
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from golem.middleware.bags.base import BagMessage, BagTopic, Sink
from golem.middleware.dds.base import DEFAULT, Participant, Payload, Qos, Reader, Sample
from golem.middleware.ros import codec, names
from golem.middleware.ros.codec import dds_name
from golem.middleware.ros.message import NANO

if TYPE_CHECKING:
    from golem.middleware.dds.discovery import Endpoint

CLOCK, CLOCK_KIND = "/clock", "rosgraph_msgs/msg/Clock"
PERIOD = 0.05
"""Time between two looks at what has come [s] [own]."""
FLUSH = 1.0
"""Time after which what was recorded survives the death of the process [s] [own]."""
BULKY = frozenset(
    f"{package}/msg/{name}"
    for package, name in (
        ("sensor_msgs", "Image"),
        ("sensor_msgs", "CompressedImage"),
        ("sensor_msgs", "PointCloud2"),
        ("livox_ros_driver2", "CustomMsg"),
    )
)
"""Types whose messages are large."""
FEW, MANY = 60, 2000
"""Messages that wait to be taken, of large and of other types [own]: 4 s at 15 Hz and at 500 Hz. They bound memory:
60 VGA images are 55 MB."""
HOLD = 1.0
"""How long a recording waits for a first /clock before it goes by the wall clock [s] [own]: messages wait in their
readers meanwhile, and in 3 s those of 500 Hz were lost."""
GONE = 1.0
"""Silence after which another writer of /clock may tell the time [s] [own]: by two at once it would jump to and fro."""
SKEW = 2.0
"""Difference between two machines' clocks beyond which the writer's time of a message is not relied on [s] [own]."""


@dataclass(slots=True)
class _Subscription:
    topic: BagTopic
    reader: Reader
    depth: int


class Recorder:
    """Passes the messages of topics to a sink.

    A message's log time is the domain's time when it was written: that of /clock where there is one, else the wall
    clock's. Its publish time is the writer's wall clock.

    Attributes:
        received: messages so far, by topic.
        overruns: how often more came between two looks than was kept, by topic: some of it was lost.
    """

    def __init__(self, participant: Participant, sink: Sink, wall: Callable[[], float] = time.time) -> None:
        """Record from the domain of `participant` to `sink`; `wall` tells the time [s since 1970]."""
        self._participant, self._sink, self._wall = participant, sink, wall
        self._subscriptions: dict[str, _Subscription] = {}
        qos = Qos(reliable=False, depth=MANY)  # whatever the writer offers: it tells the time, recorded or not
        self._ticks = participant.reader(names.topic(CLOCK), dds_name(CLOCK_KIND), qos)
        self._clock: int | None = None
        self._held_since: float | None = None
        self._teller, self._told_at = 0, float("-inf")
        self.received: dict[str, int] = {}
        self.overruns: dict[str, int] = {}

    def add(self, topics: Iterable[BagTopic]) -> None:
        """Record `topics` from now on, what is recorded already as it is. Raises DdsError: one cannot be read."""
        for topic in topics:
            if topic.name in self._subscriptions:
                continue
            if topic.name == CLOCK:
                self._subscriptions[CLOCK] = _Subscription(topic, self._ticks, MANY)
                continue
            depth = FEW if topic.kind in BULKY else MANY
            qos = Qos(topic.qos.reliable, topic.qos.transient_local, depth)
            wire, kind = names.topic(topic.name), dds_name(topic.kind)
            reader = self._participant.reader(wire, kind, qos, topic.user_data)
            self._subscriptions[topic.name] = _Subscription(topic, reader, depth)

    def remove(self, topic: str) -> None:
        """Record the topic called `topic` no longer."""
        subscription = self._subscriptions.pop(topic, None)
        if subscription is not None and subscription.reader is not self._ticks:
            subscription.reader.close()

    def poll(self, last: bool = False) -> int:
        """Pass on what has come, in the order in which it was written; return how many messages.

        At first nothing is passed on until /clock or the wall clock is known to tell the domain's time, unless this is
        the `last` time. Raises OutputError: the sink cannot be written.
        """
        now = self._wall()
        every = [(self._written(tick, now), tick) for tick in _take_all(self._ticks, MANY)]
        ticks = [(written, tick.payload) for written, tick in every if self._tells(tick, written)]
        if self._clock is None:
            self._clock = next((t for _, payload in ticks if (t := clock_time(payload)) is not None), None)
            if self._clock is None and not last and self._held(now):
                return 0
        batch = [(written, None, payload) for written, payload in ticks]
        for subscription in self._subscriptions.values():
            topic = subscription.topic
            if topic.name == CLOCK:
                continue
            samples = _take_all(subscription.reader, subscription.depth)
            if len(samples) >= subscription.depth:
                self.overruns[topic.name] = self.overruns.get(topic.name, 0) + 1
            batch += [(self._written(sample, now), topic, sample.payload) for sample in samples]
        batch.sort(key=lambda entry: (entry[0], entry[1] is not None))  # what happens at a time, happens after it
        clock = self._subscriptions.get(CLOCK)
        passed = 0
        for written, topic, payload in batch:
            if topic is None:
                at = clock_time(payload)
                self._clock = self._clock if at is None else at
                topic = clock and clock.topic
            if topic is not None:
                at = round(written * NANO)
                self._sink.write(BagMessage(topic, at if self._clock is None else self._clock, at, payload))
                self.received[topic.name] = self.received.get(topic.name, 0) + 1
                passed += 1
        return passed

    def _tells(self, tick: Sample, written: float) -> bool:
        """Return whether `tick` counts, `written` at a wall time [s]: of two clocks the first does, until it stops."""
        if clock_time(tick.payload) is None:
            return True
        if tick.writer != self._teller and abs(written - self._told_at) < GONE:
            return False
        self._teller, self._told_at = tick.writer, written
        return True

    def run(self, stop: threading.Event, flush: Callable[[], None], limit: float = float("inf")) -> None:
        """Record until `stop` is set or `limit` [s] is over, and call `flush` every second; errors as for `poll`."""
        end = time.monotonic() + limit
        flushed = time.monotonic()
        while not stop.wait(PERIOD) and time.monotonic() < end:
            self.poll()
            if time.monotonic() - flushed >= FLUSH:
                flushed = time.monotonic()
                flush()
        self.poll(last=True)

    def close(self) -> None:
        """Stop reading; the sink stays open."""
        for name in list(self._subscriptions):
            self.remove(name)
        self._ticks.close()

    def _held(self, now: float) -> bool:
        """Return whether to wait a little longer for the domain's time."""
        if self._held_since is None:
            self._held_since = now
        return now - self._held_since < HOLD

    def _written(self, sample: Sample, now: float) -> float:
        """Return when a sample was written by the wall clock, or arrived where its writer's clock is off [s]."""
        return sample.source_time if abs(sample.source_time - now) < SKEW else now


def clock_time(payload: Payload) -> int | None:
    """Return the time in a `rosgraph_msgs/msg/Clock` [ns]; None if it is no such message."""
    order = {0: ">", 1: "<"}.get(payload[1] if len(payload) == 12 else -1)
    if order is None:
        return None
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", payload, 4)
    return max(0, seconds * NANO + nanoseconds)


def _take_all(reader: Reader, maximum: int) -> list[Sample]:
    """Return what has come to a reader, at most as much as it keeps: a writer faster than us must not hold us up."""
    out: list[Sample] = []
    while len(out) < maximum:
        samples = reader.take(min(64, maximum - len(out)))
        if not samples:
            break
        out += samples
    return [sample for sample in out if sample.alive]


def topic(name: str, kind: str, qos: Qos = DEFAULT) -> BagTopic:
    """Return the topic called `name` of messages of type `kind`, whose writers offer `qos`.

    Raises:
        ConfigError: there is no such type.
        MissingExtra: rosbags, which knows the types, is not installed.
    """
    return BagTopic(name, kind, codec.definition(kind), qos, codec.type_hash(kind))


def offered(writers: Iterable[Endpoint]) -> list[BagTopic]:
    """Return the topics of `writers` that ROS could read and whose types are known here."""
    known = set(codec.codec().names())
    found: dict[str, BagTopic] = {}
    for writer in writers:
        sort, name = names.from_wire(writer.topic)
        kind = _kind(writer.type_name)
        if sort == "topic" and kind in known and name not in found:
            found[name] = topic(name, kind, writer.qos)
    return list(found.values())


def _kind(type_name: str) -> str:
    """Return the ROS name of a type from that on the wire, `sensor_msgs::msg::dds_::Image_`; empty if it has none."""
    match = re.fullmatch(r"(\w+)::(\w+)::dds_::(\w+)_", type_name)
    return "/".join(match.groups()) if match else ""
