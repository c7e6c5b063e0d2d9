"""What the documentation shows a user works when it is typed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from golem import registry
from golem.evaluation.push_bench import Trial
from golem.evaluation.subject import Subject
from golem.stack import Stack, load_stack, parse_stack

DOCS = Path(__file__).resolve().parent.parent / "docs"


def blocks(page: str, language: str) -> list[str]:
    """Return the code blocks of one language on a page."""
    return re.findall(rf"^```{language}\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.S | re.M)


def test_the_module_of_write_a_module_loads_and_grasps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, usage, *_ = blocks("how-to/write-a-module.md", "python")
    (tmp_path / "my_grasp.py").write_text(module)
    monkeypatch.chdir(tmp_path)
    exec(compile(usage, "how-to/write-a-module.md", "exec"), {})


def test_the_legs_of_write_a_module_stand_by_its_estimator(tmp_path: Path) -> None:
    *_, legs, estimator = blocks("how-to/write-a-module.md", "python")
    file, mine = tmp_path / "my_legs.py", tmp_path / "my_estimator.py"
    file.write_text(legs)
    mine.write_text(estimator)
    subject = Subject(f"{file}:Stiff", "ideal", use={"estimator": f"{mine}:Smooth"})
    trial = Trial(subject, "shove", "standing", ("front",), 5.0, index=0, seed=0)
    assert trial.run() == {"front": None}


def test_the_stack_of_write_a_module_is_valid() -> None:
    (text,) = blocks("how-to/write-a-module.md", "yaml")
    choice = parse_stack(text, "my_stack.yaml").choice("grasp_method")
    assert choice.options == {"least_score": 0.8}


def test_the_quickstart_shows_the_shipped_stack_and_the_defaults() -> None:
    (text,) = blocks("tutorial/quickstart.md", "yaml")
    shown, default = parse_stack(text, "quickstart"), Stack()
    assert shown == load_stack("tether") == default.with_choice("estimator", default.choice("estimator"))


def test_the_table_of_slots_is_complete() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \|.*\| (`.*`) \|$", (DOCS / "explanation/concepts.md").read_text(encoding="utf-8"), re.M
    )
    shown = {slot: tuple(re.findall(r"`(\w+)`", names)) for slot, names in rows}
    assert shown == {slot: registry.names(slot) for slot in registry.slots()}
