"""Brings samples from the transport's thread to the thread that spins a node, where they are handled."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from typing import Protocol

from golem.middleware.dds.base import Qos, Reader, Sample

BATCH = 64
"""Samples taken from a reader at once."""


class Source(Protocol):
    """Where a reader can be had: a participant, or what stands beside it."""

    def reader(self, topic: str, type_name: str, qos: Qos, user_data: str, on_data: Callable[[], None]) -> Reader:
        """Create a reader; see `dds.base.Participant.reader`."""
        ...


class WaitSet:
    """The inboxes of one node, and which of them have something to handle."""

    def __init__(self) -> None:
        self._ready: deque[Inbox] = deque()
        # Held until something is ready. Less to wake a thread by than an Event; and unlike a SimpleQueue (CPython 3.11)
        # it does not wait for ever where a signal outlasts the timeout.
        self._silence = threading.Lock()
        self._silence.acquire()

    def notify(self, inbox: Inbox) -> None:
        """Have `inbox` drained at the next poll. Callable from any thread."""
        self._ready.append(inbox)
        with suppress(RuntimeError):  # it is broken already
            self._silence.release()

    def poll(self) -> int:
        """Drain the inboxes that are ready now, and return how many samples were handled."""
        self._silence.acquire(blocking=False)
        handled = 0
        # What becomes ready meanwhile is left to the next poll: a flood cannot keep this one from returning.
        for _ in range(len(self._ready)):
            if not self._ready:  # a callback polled, too
                break
            handled += self._ready.popleft().drain()
        return handled

    def wait(self, timeout: float) -> None:
        """Return once something is ready, or after `timeout` [s]."""
        if not self._ready:
            self._silence.acquire(timeout=max(0.0, timeout))


class Inbox:
    """What one reader received and nobody has handled yet; keeps the newest `qos.depth` samples.

    Attributes:
        count: samples received so far.
        newest: the last of them.
    """

    def __init__(self, waitset: WaitSet, handle: Callable[[Sample], None], qos: Qos) -> None:
        """Hand samples to `handle`, one at a time, when `waitset` is polled."""
        self.count = 0
        self.newest: Sample | None = None
        self._waitset, self._handle = waitset, handle
        self._samples: deque[Sample] = deque(maxlen=qos.depth)
        self._reader: Reader | None = None
        self._lock = threading.Lock()
        self._notified = False

    def open(self, participant: Source, topic: str, type: str, qos: Qos, user_data: str) -> None:
        """Create the reader of this inbox."""
        self._reader = participant.reader(topic, type, qos, user_data, self._fill)
        self._fill()  # what came before the line above was left in the reader

    def matched(self) -> int:
        """Return how many writers match now."""
        return 0 if self._reader is None else self._reader.matched()

    @property
    def guid(self) -> bytes:
        """The reader's guid (16 bytes)."""
        assert self._reader is not None
        return self._reader.guid

    def writers(self) -> dict[int, bytes]:
        """Return the guid of every writer that matches now, by its handle."""
        return {} if self._reader is None else self._reader.writers()

    def close(self) -> None:
        """Close the reader; what was not handled is dropped."""
        with self._lock:
            reader, self._reader = self._reader, None
        if reader is not None:
            reader.close()
        self._samples.clear()

    def _fill(self) -> None:
        """Take what the reader has. Called on the transport's thread, and once on the creator's."""
        with self._lock:
            if self._reader is None:
                return
            more = True
            while more:
                samples = self._reader.take(BATCH)
                more = len(samples) == BATCH
                for sample in samples:
                    if sample.alive:
                        self._samples.append(sample)
                        self.newest = sample
                        self.count += 1
            notify = bool(self._samples) and not self._notified
            self._notified |= notify
        if notify:
            self._waitset.notify(self)

    def drain(self) -> int:
        """Handle what is there now, and return how many samples that was."""
        self._notified = False
        handled = 0
        try:
            for _ in range(len(self._samples)):
                if not self._samples:  # a callback polled, too, or closed this inbox
                    break
                handled += 1
                self._handle(self._samples.popleft())
        finally:
            if self._samples and not self._notified:
                self._notified = True
                self._waitset.notify(self)
        return handled
