"""Each example runs, says something, and is short."""

from __future__ import annotations

import runpy
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
LONGEST = 40
"""Most lines of an example."""
NEEDS = {"read_bag": "mcap"}
"""The package of an extra that an example needs."""


def test_there_are_ten() -> None:
    assert len(EXAMPLES) == 10


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_it_runs(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    needed = NEEDS.get(path.stem)
    if needed is not None and find_spec(needed) is None:
        pytest.skip(f"{needed} is not installed")
    assert len(path.read_text().splitlines()) <= LONGEST
    runpy.run_path(str(path), run_name="__main__")
    assert capsys.readouterr().out.strip()


def test_the_page_lists_them() -> None:
    page = (Path(__file__).parents[1] / "docs" / "how-to" / "examples.md").read_text()
    assert [path.name for path in EXAMPLES if f"`{path.name}`" not in page] == []
