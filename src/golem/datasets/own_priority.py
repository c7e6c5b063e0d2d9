"""Threads keep the scheduling that they had, whatever a library does to them."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

TASKS = Path("/proc/self/task")
"""A folder per thread of this process."""


@contextmanager
def own_priority() -> Iterator[None]:
    """Give this thread its scheduling back at the end, and that of this thread to those begun meanwhile; Linux only.

    SVT-AV1 4.1 gives the thread that opens an encoder and its own real-time priority 99 where it may, as root, and
    leaves it so: a recorder would then be before the safety gate.
    """
    if not (hasattr(os, "sched_setscheduler") and TASKS.is_dir()):
        yield
        return
    policy, parameter, before = os.sched_getscheduler(0), os.sched_getparam(0), set(os.listdir(TASKS))
    try:
        yield
    finally:
        for task in {*os.listdir(TASKS)} - before | {str(threading.get_native_id())}:
            with suppress(OSError):  # it has ended
                os.sched_setscheduler(int(task), policy, parameter)
