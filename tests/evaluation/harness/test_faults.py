"""A module may do its worst: it loses its trial, named where that can be told, and no other; no process stays."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from golem.evaluation.harness.ladder import LadderConfig, LadderResult, run_ladder

Make = Callable[..., LadderConfig]
MODULE = "lower_body: my_legs.py:Mine"


def run(fake: Make, method: str, limit: float = 60.0) -> LadderResult:
    """Run three trials, of which the method does its worst in number 1."""
    result = run_ladder(fake(method, n=3, limit=limit))
    assert [r.success for r in result.records] == [True, False, True]
    return result


@pytest.mark.parametrize(("method", "says"), [("leaves", "SystemExit: 3"), ("interrupts", "KeyboardInterrupt")])
def test_who_wants_to_end_the_process_loses_its_trial(
    fake: Make, method: str, says: str, capfd: pytest.CaptureFixture[str]
) -> None:
    lost = run(fake, method).records[1]
    assert (lost.stage, lost.module) == ("fault", MODULE)
    assert lost.detail.startswith(says) and "fake_rung.py" in lost.detail
    assert lost.trace is not None and "Traceback" in lost.trace and "raise" in lost.trace
    assert lost.trace in capfd.readouterr().err, "and the console says so"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("method", "says"), [("deadly", "it exited with code 3"), ("segfault", "SIGSEGV"), ("killed", "SIGKILL")]
)
def test_who_takes_its_process_along_loses_its_trial(fake: Make, method: str, says: str) -> None:
    lost = run(fake, method).records[1]
    assert (lost.stage, lost.module) == ("crash", None)
    assert lost.detail.startswith("Its process died 3 times") and says in lost.detail
    if method == "segfault":
        assert lost.trace is not None and "string_at" in lost.trace


def test_a_process_that_is_killed_once_costs_nothing(
    fake: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GOLEM_UNLUCKY", str(tmp_path / "mark"))
    result = run_ladder(fake("unlucky", n=3))
    assert [r.success for r in result.records] == [True, True, True]
    assert (tmp_path / "mark").exists()


def test_who_never_ends_is_named_and_ended(fake: Make) -> None:
    lost = run(fake, "endless", limit=3.0).records[1]
    assert (lost.stage, lost.module) == ("timeout", MODULE)
    assert "longer than 3 s" in lost.detail and "in endless" in lost.detail
    assert lost.trace is not None and "while True" in lost.trace


@pytest.mark.slow
def test_native_code_that_hangs_and_lets_no_python_run_is_ended(fake: Make) -> None:
    lost = run(fake, "stuck", limit=2.0).records[1]
    assert lost.stage == "timeout"
    assert lost.trace is not None and "in stuck" in lost.trace


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="no /proc here")
def test_what_a_module_started_ends_with_it(fake: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GOLEM_TEST", str(tmp_path))
    run(fake, "orphans", limit=2.0)
    assert marked(tmp_path) == []


def marked(mark: Path) -> list[str]:
    """The command lines of the processes that inherited the mark in their environment."""
    found: list[str] = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit() and int(entry.name) != os.getpid():
            try:
                if f"GOLEM_TEST={mark}".encode() in (entry / "environ").read_bytes():
                    found.append((entry / "cmdline").read_text())
            except OSError:
                continue
    return found


@pytest.mark.slow
def test_trials_that_share_a_past_are_run_one_by_one_when_one_of_them_kills_it(fake: Make) -> None:
    result = run_ladder(fake("fragile", rung="climb", n=1))
    found = {(r.case["side"], r.case["level"]): (r.success, r.stage) for r in result.records}
    assert found == {
        ("left", 1.0): (True, "done"),
        ("left", 2.0): (False, "crash"),
        **{("right", level): (True, "done") for level in (1.0, 2.0, 3.0, 4.0)},
    }
