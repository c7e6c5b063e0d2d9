"""Ends what a module under test computes without end."""

from __future__ import annotations

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from time import thread_time as cpu_now
from types import FrameType

from golem.traces import caller

LIMIT = 120.0
"""CPU time that one promise may take [s] [own: ten times what the slowest shipped module takes]."""
PERIOD = 0.5
"""CPU time of the process between two looks [s]."""


class Endless(BaseException):
    """A promise took more CPU time than it may; the text says where. It passes `except Exception` of a module."""


@contextmanager
def cpu_limit() -> Generator[None, None, None]:
    """Raise `Endless` in what runs within once this thread has spent `LIMIT` of CPU time.

    Only the main thread can be interrupted; elsewhere there is no limit. Native code ends before it is.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    started = cpu_now()

    def look(number: int, frame: FrameType | None) -> None:
        if cpu_now() - started > LIMIT:
            place = caller(frame) if frame is not None else None
            where = f" and had not ended at {place}" if place else ""
            raise Endless(f"it took more than {LIMIT:g} s of CPU time{where}")

    before = signal.signal(signal.SIGPROF, look)
    signal.setitimer(signal.ITIMER_PROF, PERIOD, PERIOD)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.signal(signal.SIGPROF, before)
