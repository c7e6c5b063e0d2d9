"""Compiled code is never older than what it was made from."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.sources import FILES, SOURCE

from golem import kernels
from golem.hardware.safety import base, kernel, limit_table

KERNEL = """
from golem.kernels import njit
from neighbour import LIMIT, doubled

@njit(cache=True)
def held(x):
    return min(doubled(x), LIMIT)

print(held(5.0))
"""
NEIGHBOUR = """
from golem.kernels import njit

LIMIT = {limit}

@njit(cache=True)
def doubled(x):
    return {factor} * x
"""


def test_a_kernel_follows_constants_and_kernels_of_other_files(tmp_path: Path) -> None:
    (tmp_path / "kernel.py").write_text(KERNEL)

    def result(limit: float, factor: float) -> float:
        (tmp_path / "neighbour.py").write_text(NEIGHBOUR.format(limit=limit, factor=factor))
        # Python takes its own bytecode for as new as a source of the same size and second: none is kept here.
        done = subprocess.run(
            [sys.executable, str(tmp_path / "kernel.py")],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONDONTWRITEBYTECODE": "1"},
            capture_output=True,
            text=True,
            check=True,
        )
        return float(done.stdout)

    assert [result(8.0, 2.0), result(6.0, 2.0), result(6.0, 1.0)] == [8.0, 6.0, 5.0]
    compiled = list((tmp_path / "cache").rglob("kernel.held*.nbc"))
    before = {file: file.stat().st_mtime_ns for file in compiled}
    assert result(6.0, 1.0) == 5.0
    assert {file: file.stat().st_mtime_ns for file in compiled} == before  # nothing has changed: it was not compiled


def test_the_gate_follows_its_constants() -> None:
    assert {Path(str(module.__file__)) for module in (base, limit_table)} <= kernels.sources(Path(str(kernel.__file__)))


def test_all_kernels_are_kept_so() -> None:
    direct = [
        str(path.relative_to(SOURCE))
        for path in FILES
        if re.search(r"from numba import [^\n]*\b(njit|cfunc)\b", path.read_text(encoding="utf-8"))
    ]
    assert direct == ["kernels.py"]
