"""Worker processes here: one thread each, deaf to Ctrl-C, gone with their parent, replaced when they die.

The process in which trials run: `python -m golem.evaluation.harness.local_executor FD REPORT_FD`.

It gets batches over a socket and answers each with how it ended. It is in a session of its own, so that no Ctrl-C
reaches it; the death of its parent ends it with all that it started, and so does a batch that takes too long.
"""

from __future__ import annotations

import faulthandler
import gc
import os
import queue
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Generator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from types import FrameType

from golem.evaluation.harness.copies import CAN_COPY
from golem.evaluation.harness.trials import Batch, Died, Ending, Overdue, culprit_at, run_batch, rung_of

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


SINGLE_THREAD = {
    name: "1"
    for name in (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
        "LP_NUM_THREADS",
        "MALLOC_ARENA_MAX",
    )
}
"""Environment of a worker: one thread each, the software renderer's too, so that `-j` alone sets the load and sums are
in one order; and one heap."""
START = 300.0
"""Time in which a process has to have begun its batch [s]."""
GRACE = 5.0
"""Time after a batch's limit that its process gets to say where it hangs [s]."""
REPORT = 20_000
"""Length of what is read of such a report [bytes]."""


class LocalExecutor:
    """Up to `processes` worker processes, started when there is work; see `TrialExecutor`."""

    def __init__(self, processes: int) -> None:
        """Start nothing yet."""
        self._maximum = processes
        self._waiting: deque[Batch] = deque()
        self._workers: list[_Worker] = []

    def submit(self, batch: Batch) -> None:
        """Add a batch."""
        self._waiting.append(batch)

    def results(self) -> Generator[tuple[Batch, Ending], None, None]:
        """Yield each batch and how it ended."""
        while True:
            self._give()
            busy = [worker for worker in self._workers if worker.batch is not None]
            if not busy:
                return
            soonest = min(worker.deadline for worker in busy) - time.monotonic()
            ready = set(wait([x for worker in busy for x in worker.signs], timeout=max(0.0, soonest)))
            for worker in busy:
                ending = worker.look(not ready.isdisjoint(worker.signs))
                if ending is not None:
                    batch = worker.take()
                    if worker.ended:
                        self._workers.remove(worker)
                    yield batch, ending

    def _give(self) -> None:
        """Give waiting batches to idle workers, and start a worker where none is idle."""
        while self._waiting:
            idle = next((worker for worker in self._workers if worker.batch is None), None)
            if idle is None:
                if len(self._workers) >= self._maximum:
                    return
                idle = _Worker()
                self._workers.append(idle)
            idle.give(self._waiting.popleft())

    def close(self) -> None:
        """End the processes."""
        self._waiting.clear()
        while self._workers:
            self._workers.pop().kill()


class _Worker:
    """One worker process.

    Attributes:
        batch: what it runs; None while it is idle.
        deadline: when it must have answered, on the clock `time.monotonic` [s].
        signs: what becomes readable when it has answered or died.
        ended: whether it is no more.
    """

    def __init__(self) -> None:
        self.batch: Batch | None = None
        self.deadline = 0.0
        self.ended = False
        self._report = tempfile.TemporaryFile()
        ours, its = socket.socketpair()
        with its:
            command = [sys.executable, "-P", "-m", "golem.evaluation.harness.local_executor"]
            self._process = subprocess.Popen(
                [*command, str(its.fileno()), str(self._report.fileno())],
                env={**os.environ, **SINGLE_THREAD},
                stdin=subprocess.DEVNULL,
                pass_fds=(its.fileno(), self._report.fileno()),
                start_new_session=True,
            )
        self._connection = Connection(ours.detach())
        self.signs: list[Connection | int] = [self._connection]
        if CAN_COPY:  # a copy of it would hold the connection open
            self.signs.append(os.pidfd_open(self._process.pid))
        with suppress(OSError):  # it died already, which `finish` will find
            self._connection.send(sys.path)

    def give(self, batch: Batch) -> None:
        """Let it run `batch`."""
        self.batch = batch
        self.deadline = time.monotonic() + START
        with suppress(OSError):
            self._connection.send(batch)

    def take(self) -> Batch:
        """Return its batch, which has ended."""
        batch, self.batch = self.batch, None
        assert batch is not None
        return batch

    def look(self, answered: bool) -> Ending | None:
        """Return how its batch ended, None where it goes on; where it is overdue or died, the process is ended."""
        overdue = not answered and time.monotonic() > self.deadline
        ending: Ending | None = Overdue() if overdue else Died("") if answered else None
        with suppress(EOFError, OSError):
            if answered and self._connection.poll():
                ending = self._connection.recv()
        if ending == STARTED and self.batch is not None:
            self.deadline = time.monotonic() + self.batch.limit + GRACE
            return None
        if isinstance(ending, Died | Overdue):
            if not overdue:
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(GRACE)  # so that it is known how it died
            self.kill()
            trace = os.pread(self._report.fileno(), REPORT, 0).decode(errors="replace") or None
            if isinstance(ending, Overdue) and ending.trace is None:
                ending = Overdue(trace=trace)
            elif isinstance(ending, Died) and not ending.how:
                ending = Died(_how(self._process.returncode), trace)
        return ending

    def kill(self) -> None:
        """End it and all that it started."""
        self.ended = True
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        self._connection.close()
        for sign in self.signs:
            if isinstance(sign, int):
                os.close(sign)


def _how(code: int) -> str:
    """Return how a process ended, by its return code."""
    if code >= 0:
        return f"it exited with code {code}"
    if -code == signal.SIGKILL:
        return "signal SIGKILL, as of a machine without memory"
    return f"signal {signal.Signals(-code).name}"
