"""Worker processes: one thread each, deaf to Ctrl-C, ended with their parent."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Generic, ParamSpec, TypeVar

from golem.errors import GolemError
from golem.evaluation.harness.trials import SINGLE_THREAD, start_worker

CAN_COPY = sys.platform == "linux"
"""Whether a process may go on in a copy of itself: Apple's libraries do not survive it, Windows has none."""
K = TypeVar("K")
R = TypeVar("R")
P = ParamSpec("P")


class Workers(Generic[K, R]):
    """A pool of spawned processes; leaving it early kills what is in flight.

    Work may be added while results are read.
    """

    def __init__(self, processes: int) -> None:
        """Work in up to `processes` processes; they start with the first piece of work."""
        self._before = set(multiprocessing.active_children())
        self._stack = contextlib.ExitStack()
        self._pool = ProcessPoolExecutor(
            processes, multiprocessing.get_context("spawn"), initializer=start_worker
        )
        self._pending: dict[Future[R], K] = {}

    def __enter__(self) -> Workers[K, R]:
        self._stack.enter_context(_environment(SINGLE_THREAD))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the processes."""
        self._pool.shutdown(wait=not self._pending, cancel_futures=True)
        for process in set(multiprocessing.active_children()) - self._before:
            process.terminate()
            process.join()
        self._stack.close()

    def submit(self, key: K, function: Callable[P, R], *args: P.args, **kwargs: P.kwargs) -> None:
        """Add one piece of work, called `key`.

        Raises:
            GolemError: a process died.
        """
        with _ctrl_c_held(), _named_death():
            self._pending[self._pool.submit(function, *args, **kwargs)] = key

    def finished(self) -> Generator[tuple[K, R], None, None]:
        """Yield key and result of every piece of work as it finishes.

        Raises:
            GolemError: a process died.
        """
        while self._pending:
            for future in wait(self._pending, return_when=FIRST_COMPLETED).done:
                with _named_death():
                    result = future.result()
                yield self._pending.pop(future), result


@contextlib.contextmanager
def _named_death() -> Generator[None, None, None]:
    try:
        yield
    except BrokenProcessPool:
        raise GolemError(
            "A worker process died (out of memory, or a crash in native code); finished trials are kept: "
            "give the same command again to continue."
        ) from None


@contextlib.contextmanager
def _ctrl_c_held() -> Generator[None, None, None]:
    """Hold Ctrl-C back while workers are started: they inherit the mask, so that only the parent ever hears it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _environment(variables: Mapping[str, str]) -> Generator[None, None, None]:
    """Set environment variables for the processes started meanwhile: BLAS reads them before an initialiser runs."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def in_a_copy(function: Callable[[], R]) -> R:
    """Return what `function` returns in a copy of this process: whatever it changes is as before here.

    Raises:
        GolemError: it raised, or the copy died.
    """
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        # Of forks beside threads; the only other one of a worker waits for its parent's end.
        warnings.simplefilter("ignore", DeprecationWarning)
        copy = os.fork()
    if copy == 0:
        try:
            with os.fdopen(writing, "wb") as pipe:
                pickle.dump(function(), pipe)
            os._exit(0)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        found = pipe.read()
    if os.waitpid(copy, 0)[1] != 0:
        raise GolemError("A copy of a worker process died; give the same command again to continue.")
    return pickle.loads(found)
