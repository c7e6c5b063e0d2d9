"""Plays a bag onto a domain: every message as it was recorded, at its time, with /clock."""

from __future__ import annotations

import math
import struct
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace

from golem.errors import ConfigError, unknown_name
from golem.middleware.bags.base import BagError, BagMessage, BagTopic
from golem.middleware.bags.reader import Bag
from golem.middleware.bags.recorder import CLOCK, CLOCK_KIND
from golem.middleware.bags.recorder import topic as describe
from golem.middleware.dds.base import ENCAPSULATION, DdsError, Participant, Payload, Qos, Writer
from golem.middleware.ros import codec, names
from golem.middleware.ros.message import NANO

CLOCK_STEP = NANO // 100
"""Time between two messages on a /clock that the bag does not hold [ns] [own]."""


@dataclass(frozen=True)
class PlayConfig:
    """How a bag is played.

    Attributes:
        rate: how much faster than it was recorded.
        loop: begin again at the end, until stopped; time then jumps back.
        start, stop: which part of it [s from its beginning].
        topics: names of those to play; all by default.
        wait: time in which readers can find the writers before the first message [s].
    """

    rate: float = 1.0
    loop: bool = False
    start: float = 0.0
    stop: float = math.inf
    topics: tuple[str, ...] = ()
    wait: float = 1.0

    def __post_init__(self) -> None:
        if not (self.rate > 0.0 and math.isfinite(self.rate)):
            raise ConfigError(f"The rate is {self.rate:g}; give a factor above 0, e.g. 0.5 for half as fast.")
        if not 0.0 <= self.start < self.stop:
            raise ConfigError(
                f"Nothing lies between {self.start:g} s and {self.stop:g} s; start at 0 or later, and stop after it."
            )


class Player:
    """Writes the messages of a bag."""

    def __init__(self, bag: Bag, participant: Participant, config: PlayConfig | None = None) -> None:
        """Announce the topics of `bag` on a domain. Raises ConfigError: a chosen one is absent; DdsError: no writer."""
        self._bag, self._participant, self._config = bag, participant, config or PlayConfig()
        for name in self._config.topics:
            if name in bag.foreign:
                raise ConfigError(f"{name} in {bag.path} cannot be played: {bag.foreign[name]}.")
            if name not in bag.topics:
                raise unknown_name(f"topic in {bag.path}", name, bag.topics)
        chosen = self._config.topics or tuple(bag.topics)
        self._writers = {name: self._writer(bag.topics[name]) for name in chosen}
        self._clock: Writer | None = None
        if CLOCK not in self._writers:
            self._clock = self._writer(describe(CLOCK, CLOCK_KIND, Qos(depth=1)))

    def run(self, stop: threading.Event) -> int:
        """Play until the end, or until `stop` is set; return how many messages were written.

        Raises:
            BagError: the bag, or a message in it, is damaged.
            DdsError: a reader that takes nothing holds the writers up.
        """
        stop.wait(self._config.wait)
        written = 0
        while not stop.is_set():
            written += self._play(stop)
            if not self._config.loop or written == 0:
                break
        return written

    def close(self) -> None:
        """Withdraw the topics."""
        for writer in (*self._writers.values(), self._clock):
            if writer is not None:
                writer.close()

    def _play(self, stop: threading.Event) -> int:
        begin, written = time.monotonic() - self._config.start / self._config.rate, 0
        for elapsed, writer, payload in self._events():
            due = begin + elapsed / NANO / self._config.rate
            while (lag := due - time.monotonic()) > 0.0 and not stop.is_set():
                stop.wait(lag)
            if stop.is_set():
                break
            try:
                writer.write(payload)
            except DdsError as error:
                where = f"{self._bag.path}, {elapsed / NANO:.3f} s after its beginning"
                raise BagError(f"{where}: {error}") from error
            written += writer is not self._clock
        return written

    def _events(self) -> Iterator[tuple[int, Writer, Payload]]:
        """Yield when to write what [ns since the beginning of the bag], with a /clock where the bag has none."""
        tick = newest = -1
        for elapsed, message in self._part():
            now = message.log_time
            if self._clock is not None:
                if tick < 0 or now < newest:
                    tick = now
                while tick <= now:
                    yield elapsed - (now - tick), self._clock, _clock(tick)
                    tick += CLOCK_STEP
            newest = now
            yield elapsed, self._writers[message.topic.name], message.payload

    def _part(self) -> Iterator[tuple[int, BagMessage]]:
        """Yield the messages to play with their times [ns since the beginning of the bag].

        Where time jumped back when they were recorded, the next follows at once. What holds at the start, i.e. the
        newest of each topic that keeps its last for late readers, comes first.
        """
        start, stop = self._config.start * NANO, self._config.stop * NANO
        elapsed, newest = 0, None
        held: dict[str, BagMessage] = {}
        for message in self._bag.messages(self._writers):
            elapsed += 0 if newest is None else max(0, message.log_time - newest)
            newest = message.log_time
            if elapsed > stop:
                return
            if elapsed < start:
                if message.topic.qos.transient_local:
                    held[message.topic.name] = message
                continue
            for holding in held.values():
                yield elapsed, replace(holding, log_time=message.log_time)  # it holds now: /clock begins here
            held.clear()
            yield elapsed, message

    def _writer(self, topic: BagTopic) -> Writer:
        wire, kind = names.topic(topic.name), codec.dds_name(topic.kind)
        return self._participant.writer(wire, kind, topic.qos, topic.user_data)


def _clock(time: int) -> bytes:
    return ENCAPSULATION + struct.pack("<iI", *divmod(time, NANO))
