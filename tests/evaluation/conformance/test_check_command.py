"""`golem check`: what it prints, and its exit codes."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from golem import cli, registry
from golem.errors import MissingExtra
from golem.evaluation.conformance.base import Candidate
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
        if use not in UNCHECKED.get(slot, ())
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
    assert "not asked: 'answers soundly' failed" in " ".join(said.split())
    assert f'File "{path}", line 6, in propose' in said


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
        (["grasp_method", "{depth: 1}"], "wants '{use: NAME, option: value, ...}'"),
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
