"""The page of faults says of which trials it is."""

from __future__ import annotations

from dataclasses import replace

from scripts.faults_page import page

from golem.evaluation.faults.catalogue import FAULTS
from golem.evaluation.harness.records import SCHEMA, TrialRecord

NAMES = list(FAULTS)[:2]


def record(fault: str, commit: str, success: bool = True) -> TrialRecord:
    case = {"posture": "standing", "fault": fault}
    return TrialRecord(
        schema=SCHEMA,
        rung="faults",
        method="gate",
        profile="bench",
        seed=0,
        index=0,
        overrides={},
        options={},
        case=case,
        config="",
        code="",
        commit=commit,
        versions={},
        success=success,
        stage="done" if success else "speed",
        module=None,
        detail="active.",
        timings={},
        series={},
        picture=None,
        trace=None,
    )


def test_trials_of_several_versions_are_counted_by_version() -> None:
    one, two = (record(name, "first") for name in NAMES)
    assert "versions of the code" not in page([one, two])
    text = page([one, two, replace(two, commit="second")])
    assert "The trials are of 2 versions of the code: 1, 1." in text, "of a fault tried twice the later counts"


def test_what_the_judge_did_not_accept_is_in_bold() -> None:
    assert "**speed**" in page([record(NAMES[0], "first", success=False)])
