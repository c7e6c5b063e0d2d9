"""Where batches of trials are run: processes of this machine, or a Dask cluster.

The thread of a Dask worker runs trials in a process of its own, as `-j` does here. The process keeps what a Dask worker
is not made for away from it: a trial that hangs or crashes, native code that wants to be alone and in a main thread,
single-threaded BLAS. So a trial meets there what it meets here.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Generator
from contextlib import suppress
from typing import Any, Protocol

from golem.errors import ConfigError, GolemError, needs
from golem.evaluation.harness.local_executor import LocalExecutor
from golem.evaluation.harness.trials import Batch, Died, Ending
from golem.robots.mujoco.gl import choose_backend

PATIENCE = 10.0
"""Time in which the scheduler has to answer [s]."""


class DaskExecutor:
    """Runs batches on a cluster; see `TrialExecutor`. A worker that dies has its batches run on others."""

    def __init__(self, address: str) -> None:
        """Connect to a scheduler, e.g. `tcp://10.0.0.1:8786`. Raises MissingExtra: no Dask; ConfigError: no answer."""
        with needs("distributed", "cluster"):
            import distributed
        try:
            self._client: Any = distributed.Client(address, timeout=PATIENCE)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigError(
                f"No Dask scheduler answers at {address}; start one with: dask scheduler, and: dask worker {address}"
            ) from error
        self._killed = distributed.KilledWorker
        self._done: Any = distributed.as_completed()
        self._batches: dict[Any, Batch] = {}
        if not self._client.scheduler_info()["workers"]:
            print(f"Waiting for a worker; start one with: dask worker {address}", file=sys.stderr, flush=True)

    def submit(self, batch: Batch) -> None:
        future = self._client.submit(run_remotely, batch, pure=False)
        self._batches[future] = batch
        self._done.add(future)

    def results(self) -> Generator[tuple[Batch, Ending], None, None]:
        while self._batches:
            future = next(self._done)
            batch = self._batches.pop(future)
            try:
                ending: Ending = future.result()
            except self._killed:
                ending = Died("the Dask workers that tried it died", again=False)
            except Exception as error:
                why = (str(error) or type(error).__name__).splitlines()[-1].rstrip(".")
                raise GolemError(
                    f"The Dask cluster cannot go on: {why}. Give the same command again to continue."
                ) from error
            yield batch, ending

    def close(self) -> None:
        """Take back what waits, end the idle processes of the workers, and leave the cluster."""
        with suppress(Exception):  # it may be gone
            self._client.cancel(list(self._batches))
            self._client.run(end_idle, on_error="ignore")
        with suppress(Exception):
            self._client.close(timeout=PATIENCE)


class _Processes(threading.local):
    """The process of one thread of a Dask worker."""

    def __init__(self) -> None:
        self.executor, self.busy = LocalExecutor(1), threading.Lock()
        _EVERY.append((self.executor, self.busy))


_EVERY: list[tuple[LocalExecutor, threading.Lock]] = []
_MINE = _Processes()


def run_remotely(batch: Batch) -> Ending:
    """Run `batch` in the process of this thread; what a Dask worker is asked to do."""
    choose_backend()
    with _MINE.busy:
        _MINE.executor.submit(batch)
        ((_, ending),) = _MINE.executor.results()
    return ending


def end_idle() -> None:
    """End the processes of this Dask worker that run nothing; the next batch starts them again."""
    for executor, busy in _EVERY:
        if busy.acquire(blocking=False):
            executor.close()
            busy.release()


class TrialExecutor(Protocol):
    """Runs batches, in any order; records do not depend on which executor that is.

    A batch that crashes, hangs or loses its machine ends with `Died` or `Overdue`; it never takes others with it.
    """

    def submit(self, batch: Batch) -> None:
        """Add a batch; also while results are read."""

    def results(self) -> Generator[tuple[Batch, Ending], None, None]:
        """Yield each batch and how it ended, until all have. Raises GolemError: nothing can run any more."""
        ...

    def close(self) -> None:
        """End what is in flight, and every process that was started."""


def make_executor(where: str, processes: int) -> TrialExecutor:
    """Return the executor that `--executor` names.

    Args:
        where: `local`, or `dask:ADDRESS` with the address of a scheduler.
        processes: of the local one.

    Raises:
        ConfigError: it is neither.
        golem.errors.GolemError: the cluster cannot be reached, or what it needs is not installed.
    """
    kind, _, address = where.partition(":")
    if where == "local":
        return LocalExecutor(processes)
    if kind == "dask" and address:
        return DaskExecutor(address)
    raise ConfigError(f"--executor is 'local' or 'dask:ADDRESS', e.g. dask:tcp://10.0.0.1:8786; not '{where}'.")
