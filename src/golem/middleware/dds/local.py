"""The transport contract inside one process: samples are delivered at once and in order, without threads.

Matching, history and callbacks follow the contract; there are no losses and no delays. Callbacks never nest: what is
written inside a callback is delivered at once, but its callbacks run after the present one, before the outermost
`write` returns.
"""

from __future__ import annotations

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from golem.middleware.dds.base import DdsError, NetworkPlace, Payload, Qos, Reader, Sample, Writer, as_sample


class LocalDomain:
    """What the participants of one process share; the counterpart of a DDS domain."""

    def __init__(self, clock: Callable[[], float] = time.time) -> None:
        """Start empty; `clock` gives the source time of samples [s since 1970]."""
        self.clock = clock
        self.lock = threading.RLock()
        self._numbers = itertools.count(1)
        self._writers: list[LocalWriter] = []
        self._readers: list[LocalReader] = []
        self._calls: deque[LocalReader] = deque()
        self._calling = False

    def participant(self) -> LocalParticipant:
        """Return a new member of the domain."""
        return LocalParticipant(self)

    def number(self) -> int:
        """Return a number nobody has yet: the instance handle of a new entity."""
        return next(self._numbers)

    def readers(self, writer: LocalWriter) -> list[LocalReader]:
        """Return the readers that match `writer`."""
        return [reader for reader in self._readers if _match(writer, reader)]

    def writers(self, reader: LocalReader) -> list[LocalWriter]:
        """Return the writers that match `reader`."""
        return [writer for writer in self._writers if _match(writer, reader)]

    def add_writer(self, writer: LocalWriter) -> None:
        """Let a new writer join."""
        self._writers.append(writer)

    def add_reader(self, reader: LocalReader) -> None:
        """Let a new reader join and give it the history it asks for."""
        with self.lock:
            self._readers.append(reader)
            if reader.qos.transient_local:
                for writer in self.writers(reader):
                    for sample in writer.history:
                        self.deliver(sample, reader)
        self.call_back()

    def remove_writer(self, writer: LocalWriter) -> None:
        """Let a writer leave and tell readers that have none left."""
        with self.lock:
            readers = self.readers(writer)
            self._writers.remove(writer)
            for reader in readers:
                if not self.writers(reader) and reader.heard:
                    self.deliver(Sample(b"", self.clock(), writer.handle, alive=False), reader)
        self.call_back()

    def remove_reader(self, reader: LocalReader) -> None:
        """Let a reader leave."""
        with self.lock:
            self._readers.remove(reader)

    def deliver(self, sample: Sample, reader: LocalReader) -> None:
        """Put a sample in the queue of a reader."""
        reader.queue.append(sample)
        reader.heard = sample.alive
        if reader.on_data is not None and reader not in self._calls:
            self._calls.append(reader)

    def call_back(self) -> None:
        """Run the callbacks that are due, unless somebody is already at it."""
        with self.lock:
            if self._calling:
                return
            self._calling = True
        try:
            while (reader := self._next_call()) is not None:
                waiting = len(reader.queue)
                if reader.on_data is not None:
                    reader.on_data()
                if 0 < len(reader.queue) < waiting:
                    self._calls.append(reader)
        except BaseException:
            self._calling = False
            raise

    def _next_call(self) -> LocalReader | None:
        with self.lock:
            if self._calls:
                return self._calls.popleft()
            self._calling = False
            return None


def _match(writer: LocalWriter, reader: LocalReader) -> bool:
    same = writer.topic == reader.topic and writer.type_name == reader.type_name
    return same and writer.qos.offers(reader.qos)


def _guid(participant: int, entity: int) -> bytes:
    return participant.to_bytes(12, "big") + entity.to_bytes(4, "big")


class LocalParticipant:
    """A member of a `LocalDomain`, on no network; see `base.Participant`. Nobody sees `user_data` here."""

    network: NetworkPlace | None = None

    def __init__(self, domain: LocalDomain) -> None:
        self._domain = domain
        self._number = domain.number()
        self.guid = _guid(self._number, 0x1C1)
        self._types: dict[str, str] = {}
        self._entities: list[LocalWriter | LocalReader] = []
        self._open = True

    def writer(self, topic: str, type_name: str, qos: Qos, user_data: str = "") -> Writer:
        handle = self._new(topic, type_name)
        writer = LocalWriter(self._domain, topic, type_name, qos, handle, _guid(self._number, handle))
        self._entities.append(writer)
        return writer

    def reader(
        self, topic: str, type_name: str, qos: Qos, user_data: str = "", on_data: Callable[[], None] | None = None
    ) -> Reader:
        handle = self._new(topic, type_name)
        reader = LocalReader(self._domain, topic, type_name, qos, handle, _guid(self._number, handle), on_data)
        self._entities.append(reader)
        return reader

    def close(self) -> None:
        self._open = False
        for entity in self._entities:
            entity.close()
        self._entities.clear()

    def _new(self, topic: str, type_name: str) -> int:
        """Return the handle of a new entity. Raises DdsError: the topic has another type, or this is closed."""
        if not self._open:
            raise DdsError("The participant is closed; create another one.")
        known = self._types.setdefault(topic, type_name)
        if known != type_name:
            raise DdsError(f"Topic '{topic}' already carries '{known}' here; it cannot carry '{type_name}' too.")
        return self._domain.number()


@dataclass(eq=False)
class _LocalEndpoint:
    """What writers and readers have in common; `LocalParticipant` makes them."""

    domain: LocalDomain
    topic: str
    type_name: str
    qos: Qos
    handle: int
    guid: bytes

    open = True

    def check(self, kind: str) -> None:
        if not self.open:
            raise DdsError(f"The {kind} of '{self.topic}' is closed; create another one.")


@dataclass(eq=False)
class LocalWriter(_LocalEndpoint):
    """A writer of a `LocalParticipant`; see `base.Writer`. It drops nothing."""

    dropped = 0

    def __post_init__(self) -> None:
        self.history: deque[Sample] = deque(maxlen=self.qos.depth)
        self.domain.add_writer(self)

    def write(self, payload: Payload) -> None:
        """Deliver a copy of `payload` to every matched reader before returning."""
        self.check("writer")
        data = as_sample(self.topic, payload)
        domain = self.domain
        with domain.lock:
            sample = Sample(data, domain.clock(), self.handle)
            if self.qos.transient_local:
                self.history.append(sample)
            for reader in domain.readers(self):
                domain.deliver(sample, reader)
        domain.call_back()

    def matched(self) -> int:
        return len(self.readers())

    def readers(self) -> dict[int, bytes]:
        return {r.handle: r.guid for r in self.domain.readers(self)} if self.open else {}

    def close(self) -> None:
        if self.open:
            self.open = False
            self.domain.remove_writer(self)


@dataclass(eq=False)
class LocalReader(_LocalEndpoint):
    """A reader of a `LocalParticipant`; see `base.Reader`.

    Attributes:
        queue: samples nobody has taken yet, oldest first.
        heard: whether a sample came since the last notice that the writers have gone.
    """

    on_data: Callable[[], None] | None

    def __post_init__(self) -> None:
        self.queue: deque[Sample] = deque(maxlen=self.qos.depth)
        self.heard = False
        self.domain.add_reader(self)

    def take(self, maximum: int = 64) -> list[Sample]:
        self.check("reader")
        with self.domain.lock:
            return [self.queue.popleft() for _ in range(min(maximum, len(self.queue)))]

    def matched(self) -> int:
        return len(self.writers())

    def writers(self) -> dict[int, bytes]:
        return {w.handle: w.guid for w in self.domain.writers(self)} if self.open else {}

    def close(self) -> None:
        if self.open:
            self.open = False
            self.domain.remove_reader(self)
