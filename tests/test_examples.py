"""Each example runs, says something, and is short."""

from __future__ import annotations

import json
import runpy
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples" / "notebooks").glob("*.ipynb"))
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


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    if path.stem == "4_read_a_bag" and find_spec("mcap") is None:
        pytest.skip("mcap is not installed")
    matplotlib.use("Agg")
    monkeypatch.chdir(path.parent)
    cells = [cell for cell in json.loads(path.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    names = {"__name__": "__main__"}
    for cell in cells:
        assert cell["outputs"] == [], "what was seen once is not kept: it grows stale"
        exec(compile("".join(cell["source"]), path.name, "exec"), names)
    assert capsys.readouterr().out.strip()


def test_the_page_lists_them() -> None:
    page = (ROOT / "docs" / "how-to" / "examples.md").read_text()
    assert len(NOTEBOOKS) == 4
    assert [path.name for path in (*EXAMPLES, *NOTEBOOKS) if f"`{path.name}`" not in page] == []
