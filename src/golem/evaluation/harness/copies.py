"""Goes on in a copy of this process, so that several futures can begin at one moment."""

from __future__ import annotations

import os
import pickle
import sys
import warnings
from collections.abc import Callable
from typing import TypeVar

CAN_COPY = sys.platform == "linux"
"""Whether a process may go on in a copy of itself: Apple's libraries do not survive it, Windows has none."""
R = TypeVar("R")


class CopyDied(Exception):
    """A copy of a process raised or died; run what it did in a process of its own to see why."""


def in_a_copy(function: Callable[[], R]) -> R:
    """Return what `function` returns in a copy of this process. Raises CopyDied: it raised, or the copy died."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        # Of forks while threads run; those of a worker wait for its parent's end and for its time to be over.
        warnings.simplefilter("ignore", DeprecationWarning)
        copy = os.fork()
    if copy == 0:
        try:
            with os.fdopen(writing, "wb") as pipe:
                pickle.dump(function(), pipe)
            os._exit(0)
        finally:
            os._exit(1)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        found = pipe.read()
    if os.waitpid(copy, 0)[1] != 0:
        raise CopyDied("A copy of a worker process died.")
    return pickle.loads(found)
