"""The thread of a participant that waits for data and calls back."""

from __future__ import annotations

import ctypes
import logging
import threading
from collections.abc import Callable
from typing import Protocol

from golem.middleware.dds.base import DdsError, Sample
from golem.middleware.dds.library import ANY_STATE, INFINITY, Cyclone

_log = logging.getLogger(__name__)
_AT_ONCE = 64
"""Readers that one waiting reports; the others follow in the next."""
_STOP = 0
"""What the waitset reports for its own guard condition; Cyclone's entities are positive."""


class Watched(Protocol):
    """A reader with a callback."""

    topic: str
    entity: int
    on_data: Callable[[], None] | None

    def take(self, maximum: int = 64) -> list[Sample]:
        """Remove and return up to `maximum` samples."""
        ...


class Dispatcher:
    """Calls `on_data` of the readers that have something to take, one after the other, in a thread of its own.

    A callback that raises is logged, and what its reader held is thrown away: else it would be called for the same
    samples for ever.
    """

    def __init__(self, library: Cyclone, participant: int) -> None:
        """Start the thread for `participant`, an entity."""
        self._library = library
        self._readers: dict[int, Watched] = {}
        calls = library.blocking
        self._entity = library.check(calls.dds_create_waitset(participant), "A waitset cannot be created")
        self._stop = library.check(
            calls.dds_create_guardcondition(participant), "A waitset cannot be stopped"
        )
        self._attach(self._stop, _STOP)
        self._thread = threading.Thread(target=self._run, name="dds-waitset", daemon=True)
        self._thread.start()

    def attach(self, reader: Watched) -> None:
        """Call back for `reader` from now on."""
        condition = self._library.blocking.dds_create_readcondition(reader.entity, ANY_STATE)
        self._library.check(condition, f"The reader of '{reader.topic}' cannot be waited for")
        self._readers[reader.entity] = reader
        self._attach(condition, reader.entity)

    def detach(self, entity: int) -> None:
        """Call back no more for the reader `entity`; a call under way goes on."""
        self._readers.pop(entity, None)

    def close(self) -> None:
        """End the thread, once the present callback has returned; a callback may call it too."""
        self._library.blocking.dds_set_guardcondition(self._stop, True)
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _attach(self, condition: int, label: int) -> None:
        code = self._library.blocking.dds_waitset_attach(self._entity, condition, label)
        self._library.check(code, "A condition cannot be waited for")

    def _run(self) -> None:
        labels = (ctypes.c_ssize_t * _AT_ONCE)()
        wait = self._library.blocking.dds_waitset_wait
        while True:
            n = wait(self._entity, labels, _AT_ONCE, INFINITY)
            if n < 0:  # The participant has gone without closing: with its whole domain.
                return
            for label in labels[: min(n, _AT_ONCE)]:
                if label == _STOP:
                    return
                self._call(self._readers.get(label))

    def _call(self, reader: Watched | None) -> None:
        if reader is None or reader.on_data is None:
            return
        try:
            reader.on_data()
        except Exception:
            if reader.entity not in self._readers:
                return  # It was closed meanwhile.
            _log.exception("The callback of '%s' failed; the samples it was to take are lost.", reader.topic)
            try:
                while reader.take():
                    pass
            except DdsError:
                return
