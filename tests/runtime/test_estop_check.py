from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from golem.interfaces.payloads import EstopMessage
from golem.runtime.estop_check import EstopReport

COUNTS: Any = SimpleNamespace(lost=3, late=1, skipped=12)


def test_what_is_new_is_told_once() -> None:
    report = EstopReport()
    heard = [
        (True, ""),
        (True, ""),
        (None, ""),
        (False, ""),
        (None, "it is silent"),
        (None, "it is silent"),
        (False, ""),
    ]
    told = [
        report.add(0.01 * i, None if pressed is None else EstopMessage(0.01 * i, i, pressed), fault)
        for i, (pressed, fault) in enumerate(heard)
    ]
    assert told == ["pressed", "", "", "released", "it is silent", "", "released"]
    assert report.pressed and report.released


def test_the_summary_counts() -> None:
    report = EstopReport()
    assert report.summary(COUNTS) == "No frame came."
    for i in (0, 1, 2, 3, 7):
        report.add(0.01 * i, EstopMessage(0.01 * i, i, False), "")
    assert report.summary(COUNTS) == (
        "5 frames, 57.1 per second, longest pause 40 ms; 3 lost, 1 late, 12 bytes without a frame."
    )
    assert report.released and not report.pressed
