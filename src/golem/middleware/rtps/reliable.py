"""Reliable delivery between one writer and one reader: what is sent until it is acknowledged, and what has come.

The behaviour is that of DDSI-RTPS 2.5, 8.4, less what one reader per stream makes superfluous. No sockets, no clock.
"""

from __future__ import annotations

from golem.middleware.rtps import announcements, submessages
from golem.middleware.rtps.submessages import MAX_SET, Gap, Heartbeat

RETRY = 0.1
"""How long an acknowledgement is waited for before it is asked for again [s]."""
PATIENCE = 10.0
"""How long a sample is kept for a reader that does not acknowledge it [s]."""
MAX_UNACKED = 200
"""Samples that are kept for a reader; beyond it the oldest is given up."""


class Outbox:
    """The samples of one writer for one reader."""

    def __init__(self, writer_id: bytes, reader_id: bytes, patience: float = PATIENCE) -> None:
        """Have sent nothing, and keep what is not acknowledged for `patience` [s]."""
        self._writer_id, self._reader_id, self._patience = writer_id, reader_id, patience
        self._last = self._count = 0
        self._unacked: dict[int, tuple[float, bytes]] = {}
        self._next_try = 0.0

    def put(self, qos: bytes, payload: bytes, now: float) -> list[bytes]:
        """Take a sample and return the submessages that send it."""
        self._last += 1
        sample = submessages.data(self._writer_id, self._reader_id, self._last, qos, payload)
        self._unacked[self._last] = now + self._patience, sample
        if len(self._unacked) > MAX_UNACKED:
            del self._unacked[next(iter(self._unacked))]
        self._next_try = now + RETRY
        return [sample, self._heartbeat()]

    def acknowledged(self, base: int, missing: tuple[int, ...]) -> list[bytes]:
        """Learn what the reader has, and return the submessages that it asks for."""
        for number in [number for number in self._unacked if number < base]:
            del self._unacked[number]
        again = [self._unacked[number][1] for number in missing if number in self._unacked]
        return [*again, self._heartbeat()] if missing else []

    def keep(self, now: float) -> list[bytes]:
        """Return what is due: everything that is not acknowledged, again."""
        if not self._unacked or now < self._next_try:
            return []
        self._next_try = now + RETRY
        for number in [number for number, (end, _) in self._unacked.items() if now > end]:
            del self._unacked[number]
        return [*(sample for _, sample in list(self._unacked.values())[:10]), self._heartbeat()]

    def _heartbeat(self) -> bytes:
        self._count += 1
        first = next(iter(self._unacked), self._last + 1)
        return submessages.heartbeat(self._writer_id, self._reader_id, first, self._last, self._count)


class Intake:
    """What has come from one writer for one reader."""

    def __init__(self, reader_id: bytes, writer_id: bytes) -> None:
        self._reader_id, self._writer_id = reader_id, writer_id
        self._next, self._count = 1, 0
        self._ahead: set[int] = set()

    def take(self, sequence: int) -> bool:
        """Count a sample as received, and return whether it is new; one that is too far ahead is not taken."""
        if sequence < self._next or sequence in self._ahead or sequence >= self._next + MAX_SET:
            return False
        self._ahead.add(sequence)
        self._advance()
        return True

    def heard(self, beat: Heartbeat) -> bytes:
        """Learn what the writer has, and return the acknowledgement."""
        self._skip(beat.first)
        end = min(beat.last + 1, self._next + MAX_SET)
        missing = [number for number in range(self._next, end) if number not in self._ahead]
        self._count += 1
        return submessages.ack_nack(self._reader_id, self._writer_id, self._next, missing, self._count)

    def gone(self, gap: Gap) -> None:
        """Learn what will not come."""
        if gap.start <= self._next:
            self._skip(gap.base)
        else:
            self._ahead.update(range(gap.start, min(gap.base, self._next + MAX_SET)))
        self._ahead.update(number for number in gap.more if self._next <= number < self._next + MAX_SET)
        self._advance()

    def _skip(self, to: int) -> None:
        if to > self._next:
            self._next = to
            self._ahead = {number for number in self._ahead if number >= to}
            self._advance()

    def _advance(self) -> None:
        while self._next in self._ahead:
            self._ahead.remove(self._next)
            self._next += 1


MAX_ENDPOINTS = 4096
"""Writers of one peer that are remembered, and streams to its readers."""


class FastDdsPeer:
    """A participant that has told of itself.

    Attributes:
        prefix: guid prefix (12 bytes).
        announced: what it said.
        address: where its messages come from (IPv4).
        seen: when the last came [s].
        topics: topic of each of its writers of requests, by their guid.
        writers, readers: what tells it of our writers and of our readers.
        found: what it tells of its writers.
    """

    def __init__(self, prefix: bytes, announced: announcements.Announced, address: str, now: float) -> None:
        self.prefix, self.announced, self.address, self.seen = prefix, announced, address, now
        self.topics: dict[bytes, str] = {}
        self.writers = Outbox(announcements.WRITERS_WRITER, announcements.WRITERS_READER, patience=float("inf"))
        self.readers = Outbox(announcements.READERS_WRITER, announcements.READERS_READER, patience=float("inf"))
        self.found = Intake(announcements.WRITERS_READER, announcements.WRITERS_WRITER)
        self._replies: dict[tuple[bytes, bytes], Outbox] = {}
        self._requests: dict[bytes, Intake] = {}

    def learn(self, guid: bytes, topic: str) -> None:
        """Remember a writer of requests."""
        if guid[:12] == self.prefix and topic.startswith("rq/") and len(self.topics) < MAX_ENDPOINTS:
            self.topics[guid] = topic

    def forget(self, guid: bytes) -> None:
        """Forget a writer."""
        self.topics.pop(guid, None)
        self._requests.pop(guid, None)

    def requests(self, reader_id: bytes, writer: bytes) -> Intake:
        """Return what has come from a writer (guid) for a reader of ours."""
        return self._requests.setdefault(writer, Intake(reader_id, writer[12:]))

    def replies(self, writer_id: bytes, reader_id: bytes) -> Outbox:
        """Return what goes from a writer of ours to a reader of this peer."""
        key = writer_id, reader_id
        if key not in self._replies and len(self._replies) >= MAX_ENDPOINTS:
            del self._replies[next(iter(self._replies))]
        return self._replies.setdefault(key, Outbox(*key))

    def acknowledged(self, writer_id: bytes, reader_id: bytes) -> Outbox | None:
        """Return the stream between a writer of ours and a reader of this peer, if there is one."""
        builtin = {announcements.WRITERS_WRITER: self.writers, announcements.READERS_WRITER: self.readers}
        return builtin.get(writer_id) or self._replies.get((writer_id, reader_id))

    def data_streams(self) -> list[Outbox]:
        """Return all streams of replies."""
        return list(self._replies.values())
