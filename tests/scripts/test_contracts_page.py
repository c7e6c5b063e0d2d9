"""The page of the contracts is what the sources say."""

from __future__ import annotations

from pathlib import Path

from scripts.contracts_page import page

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reference" / "contracts.md"


def test_the_page_is_up_to_date() -> None:
    advice = "write it anew: python scripts/contracts_page.py docs/reference/contracts.md"
    assert PAGE.read_text(encoding="utf-8") == page(), advice


def test_the_page_has_methods_with_their_docstrings_and_no_code() -> None:
    text = page()
    assert "    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:\n" in text
    assert "best first; empty when there is none." in text
    assert "\n        return " not in text and "self._" not in text
