"""DDS domains of which each belongs to one test alone, whatever else is tested on this machine meanwhile."""

from __future__ import annotations

import fcntl
import itertools
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DOMAINS = range(20, 101)
"""Above those that people choose by hand; their ports end below 32768, where Linux begins to give
ports to whoever asks for any."""
_turn = itertools.count(os.getpid() * 7)


@contextmanager
def free_domain() -> Iterator[int]:
    """Give a domain that no other test of this machine uses meanwhile.

    A process comes back to a domain only after all the others: what foreign software has opened in it stays open.
    """
    for _ in DOMAINS:
        domain = DOMAINS[next(_turn) % len(DOMAINS)]
        if (lock := _lock(domain)) is not None:
            break
    else:
        raise RuntimeError(f"every DDS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use by a test")
    try:
        yield domain
    finally:
        os.close(lock)


def _lock(domain: int) -> int | None:
    """Lock the file of a domain, until it is closed; None where somebody else has, or where it is another user's."""
    path = Path(tempfile.gettempdir()) / f"golem-test-domain-{domain}.lock"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    except PermissionError:
        return None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        return None
    return file
