"""Ctrl-C, and a terminal that is closed, as an event, for processes that have to complete something first."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Collection, Iterator
from contextlib import contextmanager

LIFELINE = "GOLEM_LIFELINE"
"""Environment variable of a process that is to end with the one that started it: its standard input does."""


def _end_with_it(stop: threading.Event) -> None:
    # Past Python's buffer: a thread that holds its lock makes the interpreter abort at its end.
    while os.read(0, 4096):
        pass
    stop.set()


@contextmanager
def interrupted(also: Collection[signal.Signals] = ()) -> Iterator[threading.Event]:
    """Yield an event that Ctrl-C, SIGTERM or SIGHUP sets, or the end of a `LIFELINE`; to be entered in the main thread.

    Afterwards they are as before. A SIGHUP that is ignored stays so: that is what nohup is for.

    Args:
        also: further signals that set it.
    """
    stop = threading.Event()

    def interrupt(*_: object) -> None:
        # By another thread: the handler may run while this one holds the event's lock.
        threading.Thread(target=stop.set).start()

    heeded = [signal.SIGINT, signal.SIGTERM, *also]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        heeded.append(signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in heeded}
    if os.environ.get(LIFELINE):
        threading.Thread(target=_end_with_it, args=(stop,), daemon=True).start()
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
