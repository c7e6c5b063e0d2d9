"""A module that never answers is named with the promise that was asked, and Ctrl-C says as much."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest

from golem.evaluation.conformance.base import FAILED, SKIPPED, Check
from golem.evaluation.conformance.check_command import CheckConfig, run_check
from golem.evaluation.conformance.examine import candidate, cpu_limit, examine

ENDLESS = """
class Mine:
    latency = 0.0

    def properties(self, label):
        while True:
            try:
                pass
            except Exception:
                pass
"""


@pytest.fixture
def endless(tmp_path: Path) -> str:
    path = tmp_path / "endless.py"
    path.write_text(ENDLESS)
    return f"{path}:Mine"


def test_an_endless_module_is_named_with_the_promise_and_its_line(
    endless: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("golem.evaluation.conformance.examine.LIMIT", 0.6)
    report = examine(candidate("properties", endless))
    (failed,) = report.failed
    assert failed.check == "answers_soundly"
    assert failed.reason.startswith("it took more than 0.6 s of CPU time and had not ended at endless.py:")
    after = [f for f in report.findings if f.status == SKIPPED and "'answers soundly' failed" in f.reason]
    assert len(after) == len(report.findings) - 4 and FAILED not in [f.status for f in after]


def test_another_thread_has_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("golem.evaluation.conformance.examine.LIMIT", 0.0)
    done: list[int] = []

    def work() -> None:
        with cpu_limit():
            done.append(sum(range(1000)))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [499500]


def test_ctrl_c_says_which_promise_was_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(check: Check) -> None:
        if check.name == "repeats_itself":
            raise KeyboardInterrupt

    def ask(subject: object, on_check: object) -> None:
        for name in ("answers_soundly", "repeats_itself"):
            check = Check(name, "", False, lambda suite, module: None)
            on_check(check)  # type: ignore[operator]
            interrupted(check)

    monkeypatch.setattr("golem.evaluation.conformance.check_command.examine", ask)
    with pytest.raises(KeyboardInterrupt, match="interrupted while properties: table was asked: repeats itself"):
        run_check(CheckConfig(slot="properties", use="table"))
