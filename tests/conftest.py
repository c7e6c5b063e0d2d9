"""Fixtures and settings for every test."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from tests.domains import free_domain

# MuJoCo reads this at its first import, so it must be set before any test module is collected.
if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("MUJOCO_GL", "egl")

# The processes of pytest-xdist fill the cores by themselves; threads of theirs beside that wait for each other by
# spinning, and a trainer's test took more than its two minutes. Read at the first import of torch and OpenBLAS.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# The same examples every run: a failure is repeatable, and a loaded machine is no failure.
settings.register_profile("golem", derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("golem")

REPOSITORY = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def shared() -> Path:
    """The reference material beside the repository: the vendor's model and the published figures."""
    path = REPOSITORY.parent / "shared"
    if not path.is_dir():
        pytest.skip("needs the reference material in ../shared, which is not part of this repository")
    return path


@pytest.fixture
def domain() -> Iterator[int]:
    """A DDS domain that belongs to this test alone."""
    with free_domain() as number:
        yield number
