"""A limit counts what a process computes and sleeps, not what a busy machine or a stop makes it wait."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from golem.evaluation.harness import local_executor
from golem.evaluation.harness.local_executor import OwnTime

pytestmark = pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="no /proc here")
BUSY = "import time; end = time.monotonic() + 20.0\nwhile time.monotonic() < end: pass"


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[bytes]]]:
    processes: list[subprocess.Popen[bytes]] = []
    yield processes
    for process in processes:
        process.kill()
        process.wait()


@pytest.mark.parametrize("code", [BUSY, "import time; time.sleep(60)"])
def test_who_computes_or_sleeps_takes_time(started: list[subprocess.Popen[bytes]], code: str) -> None:
    started.append(subprocess.Popen([sys.executable, "-c", code]))
    clock = OwnTime(started[0].pid)
    begun = time.monotonic()
    while clock.used() < 0.3 and time.monotonic() < begun + 60.0:
        time.sleep(0.1)
    assert 0.3 <= clock.used() <= time.monotonic() - begun + 0.1


def test_who_is_stopped_takes_none(started: list[subprocess.Popen[bytes]]) -> None:
    started.append(subprocess.Popen([sys.executable, "-c", BUSY]))
    os.kill(started[0].pid, signal.SIGSTOP)
    time.sleep(0.1)
    clock = OwnTime(started[0].pid)
    time.sleep(0.3)
    assert clock.used() == 0.0


def test_who_starves_takes_what_it_gets(started: list[subprocess.Popen[bytes]]) -> None:
    """Six that compute share one CPU."""
    cpu = next(iter(os.sched_getaffinity(0)))
    for _ in range(6):
        alone = f"import os; os.sched_setaffinity(0, {{{cpu}}}); os.nice(5)"
        started.append(subprocess.Popen([sys.executable, "-c", f"{alone}\n{BUSY}"]))
    time.sleep(0.5)
    clock, begun = OwnTime(started[0].pid), time.monotonic()
    time.sleep(1.5)
    assert clock.used() < 0.6 * (time.monotonic() - begun)


def test_what_children_compute_counts_once_they_have_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 10 s, 4 were spent waiting, all threads together; then 12 by three threads at once, of which 6 computing."""
    now, states = [0.0], iter([(0.0, 0.0, False), (6.0, 4.0, False), (12.0, 16.0, False), (12.0, 2.0, False)])
    monkeypatch.setattr(local_executor, "_state", lambda pid: next(states))
    monkeypatch.setattr(local_executor.time, "monotonic", lambda: now[0])
    clock = OwnTime(1)
    found = []
    for now[0] in (10.0, 20.0, 25.0):  # noqa: B020 - the clock
        found.append(clock.used())
    assert found == [6.0, 12.0, 17.0]
