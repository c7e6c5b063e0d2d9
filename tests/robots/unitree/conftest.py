"""Programs of the vendor's SDK as processes beside a test.

GOLEM_UNITREE_SDK names a checkout of unitree_sdk2_python; GOLEM_UNITREE_PYTHON an interpreter that has numpy and the
cyclonedds of one's choice (the SDK asks for 0.10.2, which exists for Python 3.10), this one if it is not set.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

Started = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def sdk() -> Iterator[Started]:
    """Starts a script of this folder with arguments; all are killed in the end."""
    pytest.importorskip("cyclonedds")
    if not os.environ.get("GOLEM_UNITREE_SDK"):
        pytest.skip("GOLEM_UNITREE_SDK does not name a checkout of unitree_sdk2_python")
    python = os.environ.get("GOLEM_UNITREE_PYTHON", sys.executable)
    processes: list[subprocess.Popen[str]] = []

    def start(script: str, *arguments: str) -> subprocess.Popen[str]:
        path = Path(__file__).with_name(script)
        process = subprocess.Popen(
            [python, "-u", str(path), *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        processes.append(process)
        return process

    try:
        yield start
    finally:
        for process in processes:
            process.kill()
            process.wait()
