"""Compiled code is never older than what it was made from."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from numba.core import event
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


class Strikes(event.Listener):
    """Presses Ctrl-C whenever a compilation begins."""

    def on_start(self, event: event.Event) -> None:
        signal.raise_signal(signal.SIGINT)

    def on_end(self, event: event.Event) -> None:
        pass


def test_ctrl_c_ends_a_process_after_what_it_compiles_and_is_not_lost() -> None:
    @kernels.njit
    def inner(x: float) -> float:
        return 2.0 * x

    @kernels.njit
    def outer(x: float) -> float:
        return inner(x) + 1.0

    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a process of xdist ignores it
    try:
        with event.install_listener("numba:compile", Strikes()), pytest.raises(KeyboardInterrupt):
            outer(1.0)
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(outer.signatures) == len(inner.signatures) == 1  # whole
    assert outer(1.0) == 3.0


def test_compiling_beside_the_main_thread_leaves_ctrl_c_alone() -> None:
    @kernels.njit
    def kernel(x: float) -> float:
        return x + 1.0

    handlers = list[object]()

    class Asks(Strikes):
        def on_start(self, event: event.Event) -> None:
            handlers.append(signal.getsignal(signal.SIGINT))

    with event.install_listener("numba:compile", Asks()):
        thread = threading.Thread(target=kernel, args=(1.0,))
        thread.start()
        thread.join()
    assert handlers == [signal.getsignal(signal.SIGINT)]


def test_the_gate_follows_its_constants() -> None:
    assert {Path(str(module.__file__)) for module in (base, limit_table)} <= kernels.sources(Path(str(kernel.__file__)))


def test_all_kernels_are_kept_so() -> None:
    direct = [
        str(path.relative_to(SOURCE))
        for path in FILES
        if re.search(r"from numba import [^\n]*\b(njit|cfunc)\b", path.read_text(encoding="utf-8"))
    ]
    assert direct == ["kernels.py"]
