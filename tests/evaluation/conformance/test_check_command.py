"""`golem check`: what it prints, and its exit codes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from golem import cli, registry
from golem.errors import ConfigError, MissingExtra
from golem.evaluation.conformance.base import Candidate
from golem.evaluation.conformance.check_command import BEGIN, END, CheckConfig, page_table, run_check
from golem.evaluation.conformance.examine import SUITES, UNCHECKED, candidate, examine, promises
from golem.slots import SLOTS

BROKEN = """
from golem.capabilities.grasping.centroid import Centroid

class Mine(Centroid):
    def propose(self, *given):
        return 1 / 0
"""


LONG = {"physx": pytest.mark.long}
"""Modules whose promises take half a minute, and that have tests of their own."""


def test_every_slot_has_a_suite_whose_promises_are_sentences() -> None:
    assert set(SUITES) == set(SLOTS)
    for slot in SUITES:
        checks = promises(slot)
        assert len({check.name for check in checks}) == len(checks) >= 14
        assert all(check.promise.endswith(".") for check in checks)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("slot", "use"),
    [
        pytest.param(slot, use, marks=LONG.get(use, ()))
        for slot in SUITES
        for use in registry.names(slot)
        if (slot, use) not in UNCHECKED
    ],
)
def test_every_shipped_module_keeps_its_promises(slot: str, use: str) -> None:
    report = examine(candidate(slot, use))
    assert not report.failed, [(finding.check, finding.reason) for finding in report.failed]
    assert report.lacks is None or use in ("pink_ik", "isaaclab")


def run(monkeypatch: pytest.MonkeyPatch, *words: str) -> int:
    monkeypatch.setattr(sys, "argv", ["golem", "check", *words])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert isinstance(end.value.code, int)
    return end.value.code


def test_a_module_that_is_right_ends_in_0(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(monkeypatch, "grasp_method", "{use: centroid, depth: 0.01}") == 0
    said = capsys.readouterr().out
    assert "keeps all" in said and "gap fits the hand" in said


def test_a_module_that_is_wrong_ends_in_1_and_its_line_is_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wrong_grasp.py"
    path.write_text(BROKEN)
    assert run(monkeypatch, "grasp_method", f"{path}:Mine") == 1
    said = capsys.readouterr().out
    assert "answers soundly" in said and f'File "{path}", line 6, in propose' in said


def test_json_is_all_that_is_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "wrong_grasp.py"
    path.write_text(BROKEN)
    assert run(monkeypatch, "grasp_method", f"{path}:Mine", "--json") == 1
    (report,) = json.loads(capsys.readouterr().out)
    wrong = [finding for finding in report["findings"] if finding["status"] == "failed"]
    assert (report["slot"], report["passed"], [f["check"] for f in wrong]) == (
        "grasp_method",
        False,
        ["answers_soundly"],
    )
    assert "ZeroDivisionError" in wrong[0]["reason"]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["grasp"], "Unknown slot 'grasp'"),
        (["grasp_method", "centriod"], "Did you mean 'centroid'?"),
        (["grasp_method", "nowhere.py:Mine"], "does not exist"),
        (["grasp_method", "{depth: 1}"], "is not of the form"),
        (["hand", "magpie", "--page", "nowhere.md"], "cannot be read"),
    ],
)
def test_what_cannot_be_checked_ends_in_2(
    words: list[str], sentence: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(monkeypatch, *words) == 2
    assert sentence in capsys.readouterr().err


def test_what_this_machine_lacks_is_no_fault_of_the_module() -> None:
    def make() -> None:
        raise MissingExtra("torch", "train")

    report = examine(Candidate("hand", "mine", make))
    assert report.lacks is not None and "torch" in report.lacks and not report.failed


def test_the_table_goes_between_the_marks_of_a_page(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"Before.\n{BEGIN}\nold\n{END}\nAfter.\n")
    assert run_check(CheckConfig("hand", page=page))
    text = page.read_text()
    assert text.startswith(f"Before.\n{BEGIN}\n| slot |") and text.endswith(f"{END}\nAfter.\n")
    assert "| `hand` | `magpie` |" in text and "old" not in text
    page.write_text("no marks")
    with pytest.raises(ConfigError, match="lacks the lines"):
        run_check(CheckConfig("hand", page=page))


def test_a_broken_module_is_in_the_table(tmp_path: Path) -> None:
    path = tmp_path / "wrong_grasp.py"
    path.write_text(BROKEN)
    table = page_table([examine(candidate("grasp_method", f"{path}:Mine"))])
    assert "answers soundly" in table and "`replay`" in table


def kept(path: Path, status: str, reason: str, **figures: object) -> Path:
    finding = {"check": "answers_a_step", "status": status, "reason": reason, "figures": figures}
    path.write_text(json.dumps([{"slot": "robot", "use": path.stem, "findings": [finding]}]))
    return path


def test_reports_of_robots_stand_side_by_side(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = (
        kept(tmp_path / "a.json", "passed", "", late=0.08, elbow=[0.0, 0.05, 0.1]),
        kept(tmp_path / "b.json", "passed", "", late=0.09, elbow=[0.0, 0.048, 0.1]),
        kept(tmp_path / "c.json", "failed", "it never came"),
    )
    assert run_check(CheckConfig(compare=files))
    said = capsys.readouterr().out
    assert "| promise | `a` | `b` | `c` |" in said
    assert "| **answers a step** | kept | kept | **broken**: it never came |" in said
    assert "| late | 0.08 | 0.09 | - |" in said
    assert "| elbow, off `a` | - | 2 % | - |" in said
    assert "| all | 1 kept, 0 broken | 1 kept, 0 broken | 0 kept, 1 broken |" in said
    (tmp_path / "d.json").write_text("{}")
    with pytest.raises(ConfigError, match="no report of one module"):
        run_check(CheckConfig(compare=(tmp_path / "d.json",)))


def test_only_a_robot_is_checked_on_a_domain(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cyclonedds")
    assert run(monkeypatch, "hand", "--domain", "9") == 2
    assert "a robot is checked, not 'hand'" in capsys.readouterr().err
    assert run(monkeypatch, "robot", "--domain", "0") == 2
    assert "domain 0" in capsys.readouterr().err
