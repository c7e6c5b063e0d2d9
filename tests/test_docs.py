"""What the documentation shows a user works when it is typed."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import pytest

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.push_bench import Trial
from golem.evaluation.subject import Subject
from golem.run import RunConfig, run_stack
from golem.runtime.goal_parser import parse_goal
from golem.runtime.skill_table import SkillTable
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
    choice = parse_stack(text, "my_stack.yaml").grasp_method
    assert choice.options == {"least_score": 0.8}


@pytest.fixture
def skilled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A folder with the files of write-a-skill, where one stands; the page's own test."""
    wave, greet, usage = blocks("how-to/write-a-skill.md", "python")
    (text,) = blocks("how-to/write-a-skill.md", "yaml")
    (tmp_path / "wave.py").write_text(wave)
    (tmp_path / "greet.py").write_text(greet)
    (tmp_path / "my_stack.yaml").write_text(f"{text}  greet: {{use: greet.py:Greet}}\n")
    monkeypatch.chdir(tmp_path)
    return usage


def test_the_skill_of_write_a_skill_waves(skilled: str) -> None:
    exec(compile(skilled, "how-to/write-a-skill.md", "exec"), {})


def test_the_skill_of_write_a_skill_has_the_options_that_the_page_says(
    skilled: str, capsys: pytest.CaptureFixture[str]
) -> None:
    specs = SkillTable(load_stack("my_stack.yaml")).specs
    assert specs["wave"].summary == "Raise a hand and wave it"
    assert parse_goal(specs["wave"], ["right", "--times", "3"], "golem skill wave") == {
        "side": "right",
        "times": 3,
    }
    with pytest.raises(ConfigError, match="1 to 10 times, not 11"):
        run_stack(RunConfig("my_stack.yaml", skill="wave"), ["--times", "11"])
    with pytest.raises(SystemExit):
        run_stack(RunConfig("my_stack.yaml", skill="wave"), ["--tims", "3"])
    assert "--times" in capsys.readouterr().err


@pytest.mark.slow
def test_the_skill_that_runs_skills_of_write_a_skill_waves_and_picks(
    skilled: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_stack(RunConfig("my_stack.yaml", skill="greet", profile="ideal")).success
    said = capsys.readouterr().out
    assert (
        said.index("Wave 1 of 1.")
        < said.index("Looking for a screw")
        < said.index("The screw is in the tray.")
    )


def test_the_quickstart_shows_the_shipped_stack_and_the_defaults() -> None:
    (text,) = blocks("tutorial/quickstart.md", "yaml")
    shown, default = parse_stack(text, "quickstart"), Stack()
    assert shown == load_stack("tether") == replace(default, estimator=default.choice("estimator"))


def test_the_table_of_slots_is_complete() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \|.*\| (`.*`) \|$", (DOCS / "explanation/concepts.md").read_text(encoding="utf-8"), re.M
    )
    shown = {slot: tuple(re.findall(r"`(\w+)`", names)) for slot, names in rows}
    assert shown == {slot: registry.names(slot) for slot in registry.slots()}
    assert set(shown) <= {f.name for f in fields(Stack)}
