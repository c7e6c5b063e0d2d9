"""What a pick says of screws is compared with where they were and which were loose."""

from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.base import TrialOutcome
from golem.evaluation.episodes.pick_claims import Fastener, claims
from golem.evaluation.rungs.pick_screw import verdict, verdict_tables
from golem.skills.pick_config import PickReport, Tried


def fastener(x: float, y: float, loose: bool) -> Fastener:
    p = np.array([x, y, -0.03])
    return Fastener(p, p, loose)


SCREWS = [fastener(0.43, -0.10, True), fastener(0.43, -0.20, False)]


def said(outcome: str, x: float = 0.43, y: float = -0.10, in_tray: bool = False) -> dict[str, float]:
    hands = {0: np.array([x, y, 0.0])}
    return claims(PickReport(outcome, [Tried("right", 0.0, 0.0, 0.0, outcome)]), SCREWS, set(), in_tray, hands)


@pytest.mark.parametrize(
    ("outcome", "y", "right"),
    [
        ("tight", -0.20, 1.0),
        ("tight", -0.11, 0.0),
        ("jammed", -0.11, 1.0),
        ("jammed", -0.21, 0.0),
        ("tight", -0.26, 0.0),
        ("nothing_there", -0.26, 1.0),
        ("nothing_there", -0.11, 0.0),
        ("out_of_reach", -0.11, 0.0),
    ],
)
def test_a_claim_about_a_screw(outcome: str, y: float, right: float) -> None:
    assert said(outcome, y=y) == {f"claim_{outcome}": right}


def test_a_screw_is_in_the_tray_or_not() -> None:
    assert said("picked", in_tray=True) == {"claim_picked": 1.0}
    assert said("picked") == {"claim_picked": 0.0}


def whole(outcome: str, fasteners: list[Fastener]) -> dict[str, float]:
    return claims(PickReport(outcome), fasteners, set(), False, {})


def test_claims_about_the_work_place() -> None:
    assert whole("tray_missing", SCREWS) == {"claim_tray_missing": 0.0}
    assert whole("nothing_there", []) == {"claim_nothing_there": 1.0}
    assert whole("out_of_reach", [fastener(1.2, 0.0, True)]) == {"claim_out_of_reach": 1.0}
    assert whole("out_of_reach", SCREWS) == {"claim_out_of_reach": 0.0}


@pytest.mark.parametrize(
    ("in_tray", "bore", "tray", "taken", "right"),
    [
        ("yes", "yes", True, {0}, {"claim_in_tray": 1.0, "claim_bore_empty": 1.0}),
        ("no", "no", True, {0}, {"claim_in_tray": 0.0, "claim_bore_empty": 0.0}),
        ("no", "yes", False, {1}, {"claim_in_tray": 1.0, "claim_bore_empty": 0.0}),
        ("unknown", "unknown", True, {0}, {}),
    ],
)
def test_what_it_sees_afterwards_is_compared(
    in_tray: str, bore: str, tray: bool, taken: set[int], right: dict[str, float]
) -> None:
    tried = [Tried("right", 0.0, 0.0, 0.0, "failed")]
    report = PickReport("failed", tried, in_tray=in_tray, bore_empty=bore)
    assert claims(report, SCREWS, taken, tray, {0: SCREWS[0].position}) == right


def test_what_cannot_be_judged_is_not() -> None:
    assert said("blocked") == said("failed") == said("slipped") == {}


def test_of_several_claims_the_share_counts() -> None:
    tried = [Tried("right", 0.43, -0.20, 0.0, "tight"), Tried("right", 0.43, -0.10, 0.0, "tight")]
    assert claims(PickReport("tight", tried), SCREWS, set(), False, {}) == {"claim_tight": 0.5}


def outcome(said: str, success: bool, could: bool) -> TrialOutcome:
    series = verdict(PickReport(said), success, could)
    return TrialOutcome(success, "done" if success else "detect", series=series)


def test_a_refusal_is_right_where_nothing_could_be_done() -> None:
    assert outcome("tight", False, False).series["refusal_right"] == 1.0
    assert outcome("tight", False, True).series["refusal_right"] == 0.0
    assert "refusal_right" not in outcome("slipped", False, True).series
    assert "refusal_right" not in outcome("picked", True, True).series


def test_the_table_counts_what_was_said() -> None:
    rows = [outcome("picked", True, True), outcome("picked", False, True), outcome("tight", False, False)]
    (table,) = verdict_tables({"mine": rows})
    assert table.rows == (("picked", "2", "2", "1", "1", "1"), ("tight", "1", "0", "0", "1", "0"))
