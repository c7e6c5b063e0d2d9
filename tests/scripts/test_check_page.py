"""The tables of `golem check` in pages: modules one below the other, robots side by side."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from scripts.check_page import engine_table, main, module_table, placed

from golem.evaluation.conformance.check_command import CheckConfig, run_check


def test_the_table_goes_between_the_marks_of_a_page(tmp_path: Path) -> None:
    page, report = tmp_path / "page.md", tmp_path / "hand.json"
    begin, end = "<!-- golem check: begin -->", "<!-- golem check: end -->"
    page.write_text(f"Before.\n{begin}\nold\n{end}\nAfter.\n")
    assert run_check(CheckConfig("hand", "magpie", save=report))
    main("modules", str(page), str(report))
    text = page.read_text()
    assert text.startswith(f"Before.\n{begin}\n| slot |") and text.endswith(f"{end}\nAfter.\n")
    assert "| `hand` | `magpie` |" in text and "old" not in text and "`replay`" in text
    with pytest.raises(SystemExit, match="lacks the lines"):
        placed("no marks", "", "golem check")


def found(status: str, reason: str, **figures: object) -> dict[str, Any]:
    return {"answers_a_step": {"check": "answers_a_step", "status": status, "reason": reason, "figures": figures}}


def test_a_broken_module_is_in_the_table() -> None:
    findings = list(found("failed", "it raises").values())
    table = module_table([{"slot": "hand", "use": "mine", "findings": findings}])
    assert "| `hand` | `mine` | 0 | answers a step | 0 |" in table


def test_reports_of_robots_stand_side_by_side() -> None:
    said = engine_table(
        {
            "a": found("passed", "", late=0.08, elbow=[0.0, 0.05, 0.1]),
            "b": found("passed", "", late=0.09, elbow=[0.0, 0.048, 0.1]),
            "c": found("failed", "it never came"),
        }
    )
    assert "| promise | `a` | `b` | `c` |" in said
    assert "| **answers a step** | kept | kept | **broken**: it never came |" in said
    assert "| late | 0.08 | 0.09 | - |" in said
    assert "| elbow, off `a` | - | 2 % | - |" in said
    assert "| all | 1 kept, 0 broken | 1 kept, 0 broken | 0 kept, 1 broken |" in said
