"""The page about the reasons says what the gate does."""

from __future__ import annotations

from pathlib import Path

from scripts.safety_page import REASONS, page

from golem.interfaces.payloads import Reason

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "safety.md"


def test_every_reason_has_a_number_of_its_own() -> None:
    assert set(REASONS) == set(Reason)
    assert len({text.number for text in REASONS.values()}) == len(REASONS)


def test_the_page_is_up_to_date() -> None:
    advice = "write it anew: python scripts/safety_page.py docs/reference/safety.md"
    assert PAGE.read_text(encoding="utf-8") == page(), advice
