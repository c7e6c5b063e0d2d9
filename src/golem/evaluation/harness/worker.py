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
OVER = "over"
"""What is said to a process whose batch took too long: it tells what hangs, and ends."""
DUMP = signal.SIGUSR1
"""Signal at which the interpreter writes where native code hangs, which lets no Python run."""


class Watchdog:
    """Tells the parent what hangs, and ends this process, when the parent says that a batch is over its limit."""

    def __init__(self, connection: Connection, report: int) -> None:
        """Tell it over `connection`; the file `report` gets the frames where native code keeps Python from running."""
        self._connection, self._report = connection, report
        self._answering, self._busy = threading.Lock(), False
        self._main = threading.main_thread().ident

    def run(self, batch: Batch) -> None:
        """Run `batch` and answer it; its time counts from when the rung is loaded."""
        with suppress(Exception):  # `run_batch` meets it again
            rung_of(batch)
        if not gc.get_freeze_count():
            gc.freeze()  # what is loaded stays, and is not searched after each trial
        os.ftruncate(self._report, 0)
        os.lseek(self._report, 0, os.SEEK_SET)
        self._busy = True
        self._connection.send(STARTED)
        ending = run_batch(batch)
        with self._answering:
            self._busy = False
            self._connection.send(ending)
        gc.collect()  # modules of a stack refer to each other, and keep their robot

    def over(self) -> None:
        """Answer who has control, and end this process; nothing where the batch has ended meanwhile."""
        with self._answering:
            frame: FrameType | None = sys._current_frames().get(self._main or 0)
            if not self._busy or frame is None:
                return
            by = culprit_at(frame)
            self._connection.send(Overdue(by.module, by.place, by.trace))
            _end()


def _end() -> None:
    os.killpg(0, signal.SIGKILL)


def _listen(connection: Connection, batches: queue.SimpleQueue[Batch], watchdog: Watchdog) -> None:
    """Hand over what comes in; the end of the parent ends this process."""
    try:
        while True:
            said: Batch | str = connection.recv()
            if isinstance(said, Batch):
                batches.put(said)
            elif said == OVER:
                watchdog.over()
    except (EOFError, OSError):
        _end()


def main(connection: Connection, report: int) -> None:
    """Answer batches until the parent is gone."""
    sys.path[:] = connection.recv()
    faulthandler.enable(file=report)
    faulthandler.register(DUMP, file=report)
    batches: queue.SimpleQueue[Batch] = queue.SimpleQueue()
    watchdog = Watchdog(connection, report)
    threading.Thread(target=_listen, args=(connection, batches, watchdog), daemon=True).start()
    with suppress(BrokenPipeError):  # the parent is gone
        while True:
            watchdog.run(batches.get())
    _end()


if __name__ == "__main__":
    main(Connection(int(sys.argv[1])), int(sys.argv[2]))
