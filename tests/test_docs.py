"""What the documentation shows a user works when it is typed."""

from __future__ import annotations

import re
import shlex
from pathlib import Path
from typing import Any

import pytest

from golem import registry
from golem.cli import main
from golem.errors import ConfigError
from golem.evaluation.base import RUNGS, TrialSpec
from golem.evaluation.conformance.base import FAILED
from golem.evaluation.conformance.examine import candidate, examine
from golem.evaluation.rungs.push_limit import PushLimit
from golem.robots.model.table import JOINTS
from golem.run import RunConfig, run_stack
from golem.runtime.goal_parser import parse_goal
from golem.runtime.skill_table import SkillTable
from golem.slots import SLOTS
from golem.stack import Stack, load_stack, parse_stack
from golem.training.detector.labels import CLASSES

DOCS = Path(__file__).resolve().parent.parent / "docs"


def blocks(page: str, language: str) -> list[str]:
    """Return the code blocks of one language on a page."""
    return re.findall(rf"^```{language}\n(.*?)^```", (DOCS / page).read_text(encoding="utf-8"), re.S | re.M)


@pytest.mark.parametrize(
    "page",
    [
        "how-to/write-a-hand.md",
        "how-to/write-a-localizer.md",
        "how-to/write-a-robot.md",
        "how-to/write-a-navigator.md",
        "how-to/odometry.md",
        "how-to/write-arms.md",
    ],
)
def test_the_example_of_a_slot_passes_its_own_test(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A block that begins with the name of a file is that file; the others are run."""
    monkeypatch.chdir(tmp_path)
    for block in blocks(page, "python"):
        file = re.match(r'"""([\w]+\.py): ', block)
        if file:
            (tmp_path / file[1]).write_text(block)
        else:
            exec(compile(block, page, "exec"), {})
    assert list(tmp_path.glob("my_*.py"))


@pytest.mark.parametrize(
    ("page", "slot", "use"),
    [
        ("how-to/write-a-module.md", "grasp_method", "my_grasp.py:Cautious"),
        ("how-to/write-a-module.md", "grasp_method", "my_servo_law.py:Median"),
        ("how-to/write-a-module.md", "lower_body", "my_legs.py:Stiff"),
        ("how-to/write-a-module.md", "estimator", "my_estimator.py:Smooth"),
        ("how-to/write-a-hand.md", "hand", "my_hand.py:Simple"),
        pytest.param("how-to/write-a-localizer.md", "localizer", "my_localizer.py:ColourTray", marks=pytest.mark.slow),
        ("how-to/write-a-navigator.md", "navigator", "my_navigator.py:TurnAndWalk"),
        ("how-to/write-a-robot.md", "robot", "my_robot.py:Kinematic"),
        ("how-to/write-a-skill.md", "skill", "wave.py:Wave"),
        ("how-to/write-a-skill.md", "skill", "elbow.py:Elbow"),
        ("how-to/write-arms.md", "upper_body", "my_arms.py:Damped"),
        ("how-to/write-a-planner.md", "planner", "my_planner.py:Slow"),
        ("how-to/write-a-memory.md", "memory", "my_memory.py:Mean"),
        ("how-to/write-a-mapper.md", "mapper", "my_mapper.py:Counting"),
        ("how-to/write-properties.md", "properties", "my_properties.py:Weighed"),
    ],
)
def test_an_example_keeps_the_contract_of_its_slot(
    page: str, slot: str, use: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """CPU time is left out: it is this machine's."""
    monkeypatch.chdir(tmp_path)
    name = use.partition(":")[0]
    (block,) = (block for block in blocks(page, "python") if block.startswith(f'"""{name}: '))
    (tmp_path / name).write_text(block)
    findings = examine(candidate(slot, use)).findings
    broken = [f"{f.check}: {f.reason}" for f in findings if f.status == FAILED]
    assert [line for line in broken if not line.startswith("keeps_its_time")] == []


def test_every_slot_has_its_contract_on_the_page() -> None:
    contracts = (DOCS / "reference/contracts.md").read_text(encoding="utf-8")
    for slot, row in SLOTS.items():
        module, _, name = row.contract.partition(":")
        section = contracts.partition(f"`src/{module.replace('.', '/')}.py`")[2].partition("\n## ")[0]
        assert f"### `{name}`\n" in section, slot


def test_what_is_on_no_index_is_not_told_to_be_installed_from_one() -> None:
    pages = [*DOCS.rglob("*.md"), DOCS.parent / "README.md"]
    named = [
        page.name for page in pages if re.search(r"pip install '?golem-humanoid(?!\[\w+\] @ file)", page.read_text())
    ]
    assert named == []


def test_the_table_of_motors_is_the_robots() -> None:
    page = (DOCS / "reference/motors.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\| (\d+) \| `(\w+)` \| (\S+) to (\S+) \| (\S+) \| (\S+), (\S+) \|$", page, re.M)
    assert shown == [
        (str(i), j.name.removesuffix("_joint"), f"{j.lower:.2f}", f"{j.upper:.2f}", f"{j.velocity:g}",
         f"{j.torque['urdf']:g}", f"{j.torque['paper']:g}")
        for i, j in enumerate(JOINTS)
    ]  # fmt: skip


def test_the_table_of_labels_is_the_detectors() -> None:
    page = (DOCS / "reference/labels.md").read_text(encoding="utf-8")
    assert tuple(re.findall(r"^\| `(\w+)` \|", page, re.M)) == CLASSES


def test_the_commands_that_export_the_model_write_what_the_page_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (commands,), (reads,) = (blocks("reference/model-export.md", language) for language in ("sh", "python"))
    monkeypatch.chdir(tmp_path)
    for command in commands.splitlines():
        monkeypatch.setattr("sys.argv", shlex.split(command, comments=True))
        with pytest.raises(SystemExit, match="0"):
            main()
    exec(compile(reads, "reference/model-export.md", "exec"), {})


def test_the_module_of_write_a_module_loads_and_grasps(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module, usage, *_ = blocks("how-to/write-a-module.md", "python")
    (tmp_path / "my_grasp.py").write_text(module)
    monkeypatch.chdir(tmp_path)
    exec(compile(usage, "how-to/write-a-module.md", "exec"), {})


@pytest.mark.slow
def test_the_servo_law_the_arms_and_the_localizer_of_the_pages_pick(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stack = ""
    for page, slot, use in (
        ("write-a-module", "grasp_method", "my_servo_law.py:Median"),
        ("write-a-localizer", "localizer", "my_localizer.py:ColourTray"),
        ("write-arms", "upper_body", "my_arms.py:Damped"),
    ):
        name = use.partition(":")[0]
        (block,) = (b for b in blocks(f"how-to/{page}.md", "python") if b.startswith(f'"""{name}: '))
        (tmp_path / name).write_text(block)
        stack += f"{slot}: {{use: {use}}}\n"
    (tmp_path / "my_stack.yaml").write_text(stack)
    monkeypatch.chdir(tmp_path)
    assert run_stack(RunConfig("my_stack.yaml", profile="bench")).success


def test_the_legs_of_write_a_module_stand_by_its_estimator(tmp_path: Path) -> None:
    *_, legs, estimator = blocks("how-to/write-a-module.md", "python")
    file, mine = tmp_path / "my_legs.py", tmp_path / "my_estimator.py"
    file.write_text(legs)
    mine.write_text(estimator)
    case = {"terms": "stack", "phase": "standing", "walk": "0", "direction": "front", "level": 5.0}
    use = {"estimator": f"{mine}:Smooth"}
    trial = TrialSpec("push-limit", f"{file}:Stiff", "ideal", seed=0, index=0, overrides=use, case=case)
    assert PushLimit().run(trial, None).success


def test_the_rung_of_compare_modules_judges() -> None:
    (code,) = blocks("how-to/compare.md", "python")
    space: dict[str, Any] = {}
    exec(compile(code, "how-to/compare.md", "exec"), space)
    stiff = f"{Path(__file__).parent / 'evaluation' / 'leg_methods.py'}:Stiff"
    outcome = space["StandStill"]().run(TrialSpec("stand-still", stiff, "ideal", 0, 0), None)
    assert outcome.success and outcome.series["margin_min"] > 0.05


def test_the_table_of_rungs_is_complete() -> None:
    page = (DOCS / "how-to/compare.md").read_text(encoding="utf-8")
    shown = [name for row in re.findall(r"^\| (`.*?`) \|", page, re.M) for name in re.findall(r"`([\w-]+)`", row)]
    assert sorted(shown) == sorted(RUNGS)


def test_the_stack_of_write_a_module_is_valid() -> None:
    (text,) = blocks("how-to/write-a-module.md", "yaml")
    choice = parse_stack(text, "my_stack.yaml").choice("grasp_method")
    assert choice.options == {"least_score": 0.8}


@pytest.fixture
def skilled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A folder with the files of write-a-skill, where one stands; the page's own test."""
    wave, elbow, greet, usage = blocks("how-to/write-a-skill.md", "python")
    (text,) = blocks("how-to/write-a-skill.md", "yaml")
    (tmp_path / "wave.py").write_text(wave)
    (tmp_path / "elbow.py").write_text(elbow)
    (tmp_path / "greet.py").write_text(greet)
    others = "  elbow: {use: elbow.py:Elbow}\n  greet: {use: greet.py:Greet}\n"
    (tmp_path / "my_stack.yaml").write_text(text + others)
    monkeypatch.chdir(tmp_path)
    return usage


def test_the_skill_of_write_a_skill_waves(skilled: str) -> None:
    exec(compile(skilled, "how-to/write-a-skill.md", "exec"), {})


def test_the_skill_that_moves_by_joints_of_write_a_skill_waves(
    skilled: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run_stack(RunConfig("my_stack.yaml", skill="elbow", profile="ideal"), ["--times", "1"]).success
    (off,) = re.findall(r"came back to (\S+) rad", capsys.readouterr().out)
    assert float(off) < 0.05


def test_the_skill_of_write_a_skill_has_the_options_that_the_page_says(
    skilled: str, capsys: pytest.CaptureFixture[str]
) -> None:
    specs = SkillTable(load_stack("my_stack.yaml")).specs
    assert specs["wave"].summary == "Raise a hand and wave it"
    assert parse_goal(specs["wave"], ["right", "--times", "3"], "golem skill wave") == {"side": "right", "times": 3}
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
        said.index("Wave 1 of 1.") < said.index("Looking for a screw") < said.index("The screw was dropped in the tray")
    )


def test_the_quickstart_shows_the_shipped_stack_and_the_defaults() -> None:
    (text,) = blocks("tutorial/quickstart.md", "yaml")
    shown, default = parse_stack(text, "quickstart"), Stack()
    assert shown == load_stack("tether") == default.with_choice("estimator", default.choice("estimator"))


def test_the_table_of_slots_is_complete() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \|.*\| (`.*`) \|$", (DOCS / "explanation/concepts.md").read_text(encoding="utf-8"), re.M
    )
    shown = {slot: tuple(re.findall(r"`(\w+)`", names)) for slot, names in rows}
    assert shown == {slot: registry.names(slot) for slot in SLOTS}


def test_the_home_page_names_every_module() -> None:
    rows = re.findall(r"^\| `(\w+)` \| (`.*?) \|", (DOCS / "index.md").read_text(encoding="utf-8"), re.M)
    shown = {slot: set(re.findall(r"`(\w+)`", re.sub(r"\(.*?\)", "", names))) for slot, names in rows if slot in SLOTS}
    assert shown == {slot: set(registry.names(slot)) for slot in SLOTS}
