"""What the tests of the transport share."""

from __future__ import annotations

import itertools
import os

import pytest

_used = itertools.count()


@pytest.fixture
def domain() -> int:
    """Return a DDS domain that no other test of this process uses, and hardly one of another process."""
    return 20 + (os.getpid() * 7 + next(_used)) % 180
