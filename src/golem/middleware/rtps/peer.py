"""One participant of Fast DDS, as we know it, and the streams to and from its endpoints."""

from __future__ import annotations

from golem.middleware.rtps import announcements
from golem.middleware.rtps.reliable import Intake, Outbox

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
        """Know nothing but this of it."""
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
