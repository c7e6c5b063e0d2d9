"""The time that a process takes for itself: what it computes and sleeps, not what a busy machine makes it wait."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

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
