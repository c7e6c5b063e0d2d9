"""What `golem new` writes runs, keeps its promises and is clean, and a user's tests say which promise is broken."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from golem.errors import ConfigError
from golem.evaluation.conformance.examine import SUITES, candidate, examine
from golem.evaluation.conformance.new_module import NewConfig, run_new
from golem.evaluation.harness.ladder import prepare, read_ladder
from golem.run import read_run
from golem.runtime.goal_parser import parse_goal
from golem.runtime.skill_table import SkillTable
from golem.stack import load_stack

RULES = "E,F,I,B,D,N,ANN,UP"


@pytest.fixture
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("slot", SUITES)
def test_a_new_module_keeps_every_promise_and_its_stack_names_it(slot: str, there: Path) -> None:
    run_new(NewConfig(slot, f"new_{slot}"), there)
    cls = "New" + "".join(word.capitalize() for word in slot.split("_"))
    report = examine(candidate(slot, f"new_{slot}.py:{cls}"))
    assert report.passed, [(finding.check, finding.reason) for finding in report.failed]
    stack = load_stack(f"new_{slot}.yaml")
    chosen = stack.skills["new_skill"] if slot == "skill" else stack.choice(slot)
    assert chosen.use == f"new_{slot}.py:{cls}"


@pytest.mark.parametrize("slot", SUITES)
def test_the_commands_that_are_named_next_are_commands(
    slot: str, there: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What `golem run` and `golem ladder` are told is read and found to be possible; nothing is run."""
    run_new(NewConfig(slot, "mine"), there)
    _, *lines = capsys.readouterr().out.splitlines()
    words = {line.split()[1]: line.split()[2:] for line in lines}
    config, goal = read_run(words["run"])
    stack = load_stack(config.stack)
    parse_goal(SkillTable(stack).specs[config.skill or "pick"], goal, "golem run")
    assert slot != "navigator" or (config.skill == "walk" and stack.on_ground)
    assert ("ladder" in words) == (slot not in ("robot", "skill"))
    if "ladder" in words:
        request, _ = prepare(read_ladder(words["ladder"]).whole())
        assert "mine.py:Mine" in {*request.methods, *request.example.overrides.values()}


def test_what_is_written_is_clean(there: Path) -> None:
    for slot in SUITES:
        run_new(NewConfig(slot, f"my_{slot}"), there)
    ruff = Path(sys.executable).parent / "ruff"
    for words in (["check", "--select", RULES, "--ignore", "D105,D107,D203,D213,N806"], ["format", "--check"]):
        ran = subprocess.run(
            [ruff, words[0], "--isolated", "--line-length", "110", *words[1:], "."], capture_output=True, text=True
        )
        assert ran.returncode == 0, ran.stdout


def test_nothing_is_overwritten(there: Path) -> None:
    (there / "test_mine.py").write_text("mine")
    with pytest.raises(ConfigError, match="test_mine.py is there already"):
        run_new(NewConfig("hand", "mine"), there)
    assert [path.name for path in there.iterdir()] == ["test_mine.py"]


@pytest.mark.parametrize(
    ("slot", "name", "sentence"),
    [
        ("hnad", "mine", "Did you mean 'hand'?"),
        ("hand", "My-Hand", "lower-case words joined by _ and no word of Python's; not 'My-Hand'"),
        ("hand", "class", "no word of Python's; not 'class'"),
        ("hand", "import", "not 'import'"),
    ],
)
def test_a_name_that_cannot_be_is_answered_with_one_that_can(slot: str, name: str, sentence: str, there: Path) -> None:
    with pytest.raises(ConfigError, match=sentence.replace("?", r"\?")):
        run_new(NewConfig(slot, name), there)


def test_a_users_tests_name_the_promise_that_is_broken(there: Path) -> None:
    run_new(NewConfig("grasp_method", "mine"), there)
    source = (there / "mine.py").read_text()
    (there / "mine.py").write_text(source.replace("self._gap, target", "9.0, target"))
    ran = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_mine.py"], capture_output=True, text=True
    )
    assert ran.returncode == 1
    assert "test_mine[gap_fits_the_hand]" in ran.stdout and "1 failed" in ran.stdout
    assert "it wants a gap of 9 m, the hand opens to" in ran.stdout
