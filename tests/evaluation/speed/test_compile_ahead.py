"""Kernels are compiled once, ahead of the processes that need them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from golem.capabilities.planning import plan_kernel
from golem.evaluation.speed import compile_ahead

COUNT = """
import sys
from golem.cli import _prepare_graphics
_prepare_graphics()
from numba.core.dispatcher import Dispatcher
from golem.evaluation.speed.compile_ahead import compile_kernels
compile_kernels()
for name, module in sorted(sys.modules.items()):
    for key, value in vars(module).items() if name.startswith("golem.") else ():
        if isinstance(value, Dispatcher) and value.py_func.__module__ == name and not value.nopython_signatures:
            print(f"{name}.{key}")
"""


def test_only_what_is_older_than_its_source_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    codes = [1, 0]
    monkeypatch.setattr(subprocess, "run", lambda words, check: subprocess.CompletedProcess(words, codes.pop(0)))
    monkeypatch.setattr(plan_kernel.verdict, "_cache", type("Cache", (), {"cache_path": str(tmp_path)}))
    assert compile_ahead.compile_if_cold() is not None  # it failed: the next one tries again
    assert compile_ahead.compile_if_cold() is not None
    assert compile_ahead.compile_if_cold() is None
    monkeypatch.setattr(compile_ahead, "stamp_of_all", lambda: "of an edited source")
    codes.append(0)
    assert compile_ahead.compile_if_cold() is not None


@pytest.mark.slow
@pytest.mark.long  # it compiles all of them
@pytest.mark.timeout(900)
def test_no_kernel_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    found = subprocess.run([sys.executable, "-c", COUNT], capture_output=True, text=True, check=True)
    # What estimators call outside of the chain: the chain calls `contact` and `fuse`.
    assert set(found.stdout.split()) <= {
        "golem.hardware.estimator.feet_kernel.contacts",
        "golem.hardware.estimator.random_walk_kf._fuse_all",
    }
