"""The process in which trials run: `python -m golem.evaluation.harness.worker FD REPORT_FD`.

It gets batches over a socket and answers each with how it ended. It is in a session of its own, so that no Ctrl-C
reaches it; the death of its parent ends it with all that it started, and so does a batch that takes too long.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import queue
import signal
import sys
import threading
from contextlib import suppress
from multiprocessing.connection import Connection
from types import FrameType

from golem.evaluation.harness.trials import Batch, Overdue, culprit_at, run_batch, rung_of

STARTED = "started"
"""What is answered when a batch begins; its ending follows."""
LATE = 2.0
"""Time after a batch's limit at which the interpreter writes where native code hangs [s], which lets no Python run."""


class Watchdog:
    """Tells the parent what hangs, and ends this process, when a batch outlasts its limit."""

    def __init__(self, connection: Connection, report: int) -> None:
        """Tell it over `connection`, or write it to the file `report` where native code keeps Python from running."""
        self._connection, self._report = connection, report
        self._answering = threading.Lock()
        self._main = threading.main_thread().ident

    def run(self, batch: Batch) -> None:
        """Run `batch` and answer it; its time counts from when the rung is loaded."""
        with suppress(Exception):  # `run_batch` meets it again
            rung_of(batch)
        self._connection.send(STARTED)
        over = threading.Event()
        watch = threading.Thread(target=self._watch, args=(batch.limit, over), daemon=True)
        os.ftruncate(self._report, 0)
        os.lseek(self._report, 0, os.SEEK_SET)
        faulthandler.dump_traceback_later(batch.limit + LATE, file=self._report)
        watch.start()
        ending = run_batch(batch)
        faulthandler.cancel_dump_traceback_later()
        with self._answering:
            over.set()
            self._connection.send(ending)
        watch.join()
        gc.collect()  # modules of a stack refer to each other, and keep their robot

    def _watch(self, limit: float, over: threading.Event) -> None:
        if over.wait(limit):
            return
        with self._answering:
            frame: FrameType | None = sys._current_frames().get(self._main or 0)
            if over.is_set() or frame is None:
                return
            by = culprit_at(frame)
            self._connection.send(Overdue(by.module, by.place, by.trace))
            _end()


def _end() -> None:
    """End this process and all that it started."""
    os.killpg(0, signal.SIGKILL)


def _listen(connection: Connection, batches: queue.SimpleQueue[Batch]) -> None:
    """Hand over what comes in; the end of the parent ends this process."""
    try:
        while True:
            batches.put(connection.recv())
    except (EOFError, OSError):
        _end()


def main(connection: Connection, report: int) -> None:
    """Answer batches until the parent is gone."""
    sys.path[:] = connection.recv()
    faulthandler.enable(file=report)
    batches: queue.SimpleQueue[Batch] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(connection, batches), daemon=True).start()
    watchdog = Watchdog(connection, report)
    while True:
        watchdog.run(batches.get())


if __name__ == "__main__":
    main(Connection(int(sys.argv[1])), int(sys.argv[2]))
