"""What a pick says of screws is compared with where they were and which were loose."""

from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.episodes.pick_claims import Fastener, claims
from golem.skills.pick_report import PickReport, Tried


def fastener(x: float, y: float, loose: bool) -> Fastener:
    p = np.array([x, y, -0.03])
    return Fastener(p, p, loose)


SCREWS = [fastener(0.43, -0.10, True), fastener(0.43, -0.20, False)]


def said(outcome: str, x: float = 0.43, y: float = -0.10, in_tray: bool = False) -> dict[str, float]:
    return claims(PickReport(outcome, [Tried("right", x, y, -0.03, outcome)]), SCREWS, in_tray)


@pytest.mark.parametrize(
    ("outcome", "y", "right"),
    [
        ("tight", -0.20, 1.0),
        ("tight", -0.11, 0.0),
        ("jammed", -0.11, 1.0),
        ("jammed", -0.21, 0.0),
        ("tight", -0.15, 0.0),
        ("nothing_there", -0.15, 1.0),
        ("nothing_there", -0.11, 0.0),
        ("out_of_reach", -0.11, 0.0),
    ],
)
def test_a_claim_about_a_screw(outcome: str, y: float, right: float) -> None:
    assert said(outcome, y=y) == {f"claim_{outcome}": right}


def test_a_screw_is_in_the_tray_or_not() -> None:
    assert said("picked", in_tray=True) == {"claim_picked": 1.0}
    assert said("picked") == {"claim_picked": 0.0}


def test_claims_about_the_work_place() -> None:
    far = [fastener(1.2, 0.0, True)]
    assert claims(PickReport("tray_missing"), SCREWS, False) == {"claim_tray_missing": 0.0}
    assert claims(PickReport("nothing_there"), [], False) == {"claim_nothing_there": 1.0}
    assert claims(PickReport("out_of_reach"), far, False) == {"claim_out_of_reach": 1.0}
    assert claims(PickReport("out_of_reach"), SCREWS, False) == {"claim_out_of_reach": 0.0}


def test_what_cannot_be_judged_is_not() -> None:
    assert said("blocked") == said("failed") == said("slipped") == {}


def test_of_several_claims_the_share_counts() -> None:
    tried = [Tried("right", 0.43, -0.20, 0.0, "tight"), Tried("right", 0.43, -0.10, 0.0, "tight")]
    assert claims(PickReport("tight", tried), SCREWS, False) == {"claim_tight": 0.5}
