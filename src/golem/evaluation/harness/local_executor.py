"""Worker processes here: one thread each, deaf to Ctrl-C, gone with their parent, replaced when they die."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path

from golem.evaluation.harness.copies import CAN_COPY
from golem.evaluation.harness.trials import Batch, Died, Ending, Overdue
from golem.evaluation.harness.worker import DUMP, OVER, STARTED

TICK = 1.0 / os.sysconf("SC_CLK_TCK")
"""Unit of the CPU times in /proc [s]."""


class OwnTime:
    """Counts from when it is made. Without Linux's /proc it is the time of the clock.

    A process that is stopped, as with Ctrl-Z or by a debugger, takes none.
    """

    def __init__(self, pid: int) -> None:
        """Count for the process `pid` and all that it started."""
        self._pid, self._used = pid, 0.0
        self._at, self._cpu, self._waited, _ = time.monotonic(), *_state(pid)

    def used(self) -> float:
        """Return the time so far [s]; a stop is seen only where this is asked every few seconds."""
        at, (cpu, waited, stopped) = time.monotonic(), _state(self._pid)
        passed = at - self._at
        # Several threads may wait at once, and what has ended waits no more: it took at least what it computed.
        took = 0.0 if stopped else min(passed, max(cpu - self._cpu, passed - max(waited - self._waited, 0.0)))
        self._used += max(took, 0.0)
        self._at, self._cpu, self._waited = at, cpu, waited
        return self._used


def _state(pid: int) -> tuple[float, float, bool]:
    """Return what a process and its descendants computed and waited for a CPU [s], and whether it is stopped."""
    cpu = waited = 0.0
    stopped = False
    for i, folder in enumerate(_tree(Path("/proc") / str(pid))):
        with suppress(OSError, ValueError, IndexError):
            words = (folder / "stat").read_text().rpartition(")")[2].split()  # man 5 proc: the third field on
            cpu += TICK * sum(map(int, words[11:15]))
            stopped = stopped or (i == 0 and words[0] in "Tt")
            for thread in (folder / "task").iterdir():
                waited += 1e-9 * int((thread / "schedstat").read_text().split()[1])
    return cpu, waited, stopped


def _tree(folder: Path) -> Iterator[Path]:
    yield folder
    with suppress(OSError):
        for thread in (folder / "task").iterdir():
            for child in (thread / "children").read_text().split():
                yield from _tree(folder.parent / child)


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
"""Own time in which a process has to have begun its batch [s]."""
GRACE = 5.0
"""Own time after a batch's limit that its process gets to say where it hangs; then the interpreter gets as much [s]."""
PERIOD = 5.0
"""Time between two looks at what a process has taken [s]."""
REPORT = 20_000
"""Length of what is read of such a report [bytes]."""


class LocalExecutor:
    """Up to `processes` worker processes, started when there is work; see `TrialExecutor`."""

    def __init__(self, processes: int) -> None:
        self._maximum = processes
        self._waiting: deque[Batch] = deque()
        self._workers: list[_Worker] = []

    def submit(self, batch: Batch) -> None:
        self._waiting.append(batch)

    def results(self) -> Generator[tuple[Batch, Ending], None, None]:
        while True:
            self._give()
            busy = [worker for worker in self._workers if worker.batch is not None]
            if not busy:
                return
            soonest = min(worker.due for worker in busy) - time.monotonic()
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
        self._waiting.clear()
        while self._workers:
            self._workers.pop().kill()


class _Worker:
    """One worker process.

    Attributes:
        batch: what it runs; None while it is idle.
        due: when it is to be looked at again, on the clock `time.monotonic` [s].
        signs: what becomes readable when it has answered or died.
        ended: whether it is no more.
    """

    def __init__(self) -> None:
        self.batch: Batch | None = None
        self.due = 0.0
        self.ended = False
        self._report = tempfile.TemporaryFile()
        ours, its = socket.socketpair()
        with its:
            command = [sys.executable, "-P", "-m", "golem.evaluation.harness.worker"]
            ends, env, null = (its.fileno(), self._report.fileno()), {**os.environ, **SINGLE_THREAD}, subprocess.DEVNULL
            command += map(str, ends)
            self._process = subprocess.Popen(command, env=env, stdin=null, pass_fds=ends, start_new_session=True)
        self._connection = Connection(ours.detach())
        self.signs: list[Connection | int] = [self._connection]
        if CAN_COPY:  # a copy of it would hold the connection open
            self.signs.append(os.pidfd_open(self._process.pid))
        with suppress(OSError):  # it died already, which `finish` will find
            self._connection.send(sys.path)

    def give(self, batch: Batch) -> None:
        """Let it run `batch`."""
        self.batch = batch
        self._count(START)
        with suppress(OSError):
            self._connection.send(batch)

    def take(self) -> Batch:
        """Return its batch, which has ended."""
        batch, self.batch = self.batch, None
        assert batch is not None
        return batch

    def look(self, answered: bool) -> Ending | None:
        """Return how its batch ended, None where it goes on; where it is overdue or died, the process is ended."""
        overdue = not answered and self._overdue()
        ending: Ending | None = Overdue() if overdue else Died("") if answered else None
        with suppress(EOFError, OSError):
            if answered and self._connection.poll():
                ending = self._connection.recv()
        if ending == STARTED and self.batch is not None:
            self._count(self.batch.limit)
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

    def _count(self, limit: float) -> None:
        """Begin to count what it takes, of which it may take `limit` [s]."""
        self._own, self._limit, self._warned = OwnTime(self._process.pid), limit, 0
        self.due = time.monotonic() + min(limit, PERIOD)

    def _overdue(self) -> bool:
        """Return whether it took too long, and has been told so in vain: first it, then its interpreter."""
        if time.monotonic() < self.due:
            return False
        left = self._limit - self._own.used()
        if left <= 0.0:
            self._warned += 1
            with suppress(OSError):
                if self._warned == 1:
                    self._connection.send(OVER)
                elif self._warned == 2:
                    os.kill(self._process.pid, DUMP)
                else:
                    return True
            self._limit, left = self._limit + GRACE, left + GRACE
        self.due = time.monotonic() + min(max(left, 0.01), PERIOD)
        return False

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
    if code >= 0:
        return f"it exited with code {code}"
    if -code == signal.SIGKILL:
        return "signal SIGKILL, as of a machine without memory"
    return f"signal {signal.Signals(-code).name}"
