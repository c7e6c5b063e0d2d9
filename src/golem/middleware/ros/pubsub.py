"""Publishers and subscriptions over the transport contract."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from golem.middleware.dds.base import Qos, Sample
from golem.middleware.ros import codec, names
from golem.middleware.ros.message import CodecError
from golem.middleware.ros.node_endpoints import NodeEndpoints


class Publisher:
    """Sends messages on one topic."""

    def __init__(self, endpoints: NodeEndpoints, name: str, type: str, qos: Qos) -> None:
        """Publish messages of `type` on the topic with absolute `name`."""
        self.name, self._kind = name, codec.message(type)
        self._endpoints = endpoints
        self.writer = endpoints.writer(names.topic(name), type, qos)

    def publish(self, message: Any) -> None:
        """Send one message. Raises CodecError: it is not of the topic's type."""
        self.writer.write(codec.serialize_as(f"Topic '{self.name}'", message, self._kind))

    def matched(self) -> int:
        """Return how many subscriptions are known to listen now."""
        return self.writer.matched()

    def close(self) -> None:
        """Stop; calling it again does nothing."""
        self._endpoints.close(self.writer)


class Subscription:
    """Receives the messages of one topic; `malformed` counts samples that were none of its type."""

    def __init__(
        self, endpoints: NodeEndpoints, name: str, type: str, callback: Callable[[Any], None] | None, qos: Qos
    ) -> None:
        """Give messages of `type` on the topic with absolute `name` to `callback`, if there is one."""
        self.name, self.malformed = name, 0
        self._kind, self._callback, self._endpoints = codec.message(type), callback, endpoints
        self._latest: Any | None = None
        self._seen: Sample | None = None
        self.inbox = endpoints.inbox(names.topic(name), type, qos, self._take)

    def latest(self) -> Any | None:
        """Return the newest message, or None before the first; this needs no spinning."""
        sample = self.inbox.newest
        if sample is not None and sample is not self._seen:
            self._seen = sample
            message = self._read(sample)
            self._latest = self._latest if message is None else message
        return self._latest

    def count(self) -> int:
        """Return how many messages have come so far: a reader sees by it that one is new."""
        return self.inbox.count

    def matched(self) -> int:
        """Return how many publishers are known now."""
        return self.inbox.matched()

    def close(self) -> None:
        """Stop; calling it again does nothing."""
        self._endpoints.close(self.inbox)

    def _take(self, sample: Sample) -> None:
        if self._callback is not None:
            message = self._read(sample)
            if message is not None:
                self._callback(message)

    def _read(self, sample: Sample) -> Any | None:
        try:
            return codec.deserialize(sample.payload, self._kind)
        except CodecError:
            self.malformed += 1
            return None
