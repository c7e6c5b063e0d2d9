"""Ctrl-C as an event, for processes that have to complete something first."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interrupted() -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C or SIGTERM sets; to be entered in the main thread. Afterwards they are as before."""
    stop = threading.Event()

    def interrupt(*_: object) -> None:
        # By another thread: the handler may run while this one holds the event's lock.
        threading.Thread(target=stop.set).start()

    before = {number: signal.signal(number, interrupt) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
