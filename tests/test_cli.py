"""What a user gets wrong on the command line ends in one sentence that names what would be right, and exit code 2."""

from __future__ import annotations

import os
import sys
import warnings
from pathlib import Path

import pytest

from golem import cli
from golem.errors import SlowModule

BROKEN = {
    "no command": ([], None),
    "command": (["ladr"], "Did you mean 'ladder'?"),
    "rung": (["ladder", "--rung", "teter"], "walk-twist. Did you mean 'tether'?"),
    "method": (["ladder", "--method", "centriod"], "Did you mean 'centroid'?"),
    "method file": (["ladder", "--method", "x.py:Mine"], "does not exist"),
    "option of a rung": (["ladder", "--rung", "push-limit", "--first", "0"], "--first is 0; it must be more"),
    "executor": (["ladder", "--executor", "slurm"], "'local' or 'dask:ADDRESS'"),
    "trial": (["ladder", "--show", "nobody:3"], "Unknown trial 'nobody:3'"),
    "results": (["results", "nowhere"], "nowhere holds no trials"),
    "profile": (["ladder", "--profile", "feild"], "valid: bench, field, ideal"),
    "n": (["ladder", "-n", "0"], "-n is 0; it must be 1 or more"),
    "slot": (["ladder", "--use", "upperbody=diff_ik"], "Did you mean 'upper_body'?"),
    "implementation": (["ladder", "--use", "upper_body=difik"], "Did you mean 'diff_ik'?"),
    "use": (["ladder", "--use", "upper_body"], "slot=implementation"),
    "stack": (["run", "nowhere"], "hall, stand, tether"),
    "folder as a stack": (["run", "."], "No stack file '.'; give a path to a YAML file"),
    "no stack": (["run", ""], "No stack file ''; give a path to a YAML file"),
    "request": (["safety", "stpo"], "release, reset, status, stop, take. Did you mean 'stop'?"),
    "study": (["study", "none.yaml"], "Cannot read the study none.yaml: No such file or directory; see"),
    "data set": (["dataset", "check", "demos"], "demos/meta/info.json cannot be read (No such file or directory)."),
    "rules": (["mcp", "stand", "--rules", "none.yaml"], "The rules 'none.yaml' cannot be read: No such file or dir"),
    "folder as a template": (["real", "--template", "."], ". is there already; choose another name."),
    "run seed": (["run", "--seed", "-1"], "The seed is -1; it must be 0 or more"),
    "bench": (["bench", "plan"], "Unknown bench 'plan'; valid: arms, grasp,"),
    "number": (["ladder", "-n", "ten"], "-n is a whole number, not 'ten'."),
    "option of a method": (
        ["ladder", "--method", "{use: visual_servo, gian: 3}"],
        "Unknown option of grasp_method: visual_servo 'gian'; valid: centroid, servo.",
    ),
    "bench seed": (["bench", "--seed", "-1"], "--seed is -1; it must be 0 or more"),
    "run profile": (["run", "--profile", "feild"], "Did you mean 'field'?"),
    "skill": (["run", "--skill", "pik"], "stand, take, walk. Did you mean 'pick'?"),
    "skill goal": (["run", "--skill", "walk", "--x", "nan"], "'x' is a finite number"),
    "skill and by hand": (["run", "--skill", "pick", "--operate"], "give it or --skill, not both"),
    "skill of a domain": (["skill"], "Say which skill"),
    "format": (["model", "export", "--format", "step", "--out", "x"], "valid: mjcf, urdf"),
    "model": (["model", "import"], "valid: export, spheres"),
    "spheres": (["model", "spheres", "none.urdf"], "Cannot read 'none.urdf'"),
    "device": (["drivers", "estp"], "Did you mean 'estop'?"),
    "board": (["drivers", "estop", "/dev/no_board"], "'/dev/no_board' cannot be opened"),
    "hands": (["drivers", "hands"], "--left.port /dev/ttyUSB0"),
    "bus": (["drivers", "hands", "--left.port", "/dev/no_bus"], "'/dev/no_bus' cannot be opened"),
    "lidar": (["drivers", "lidar", "192.0.2.1"], "Nobody can listen to the LiDAR at 192.0.2.1"),
    "board's port": (["safety", "--estop.use", "serial"], "estop: {use: serial, port: /dev/ttyACM0}"),
    "train": (["train", "arms"], "valid: act, detector, grasps, legs"),
}


@pytest.mark.parametrize("words, sentence", BROKEN.values(), ids=BROKEN.keys())
def test_a_wrong_word_is_answered_in_one_sentence_and_writes_nothing(
    words: list[str],
    sentence: str | None,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["golem", *words])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == cli.BAD_INPUT
    said = capsys.readouterr()
    if sentence is None:
        assert "usage: golem COMMAND" in said.out
    else:
        assert said.err.startswith("golem: ") and said.err.count("\n") == 1
        assert sentence in said.err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("text, sentence", [("upper_body: [", "line 1"), ("uper_body: diff_ik", "'upper_body'")])
def test_a_broken_stack_file_names_file_and_place(
    text: str, sentence: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.yaml").write_text(text)
    monkeypatch.setattr(sys, "argv", ["golem", "run", str(tmp_path / "mine.yaml")])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == cli.BAD_INPUT
    error = capsys.readouterr().err
    assert "mine.yaml" in error and sentence in error


def test_an_unwritable_folder_is_refused_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["golem", "ladder", "-n", "1", "--out", os.devnull + "/results"])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == cli.BAD_INPUT
    assert "Cannot write to --out" in capsys.readouterr().err


def test_the_model_is_exported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for words in (["--format", "urdf"], ["--format", "mjcf", "--no-hands"]):
        out = tmp_path / "model.xml"
        monkeypatch.setattr(sys, "argv", ["golem", "model", "export", *words, "--out", str(out)])
        with pytest.raises(SystemExit) as end:
            cli.main()
        assert end.value.code == 0
        assert "left_knee" in out.read_text()


def test_a_modules_fault_ends_in_its_sentence_and_the_lines_that_led_to_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text("import golem\n1 / 0\n")
    (tmp_path / "mine.yaml").write_text(f"upper_body: {tmp_path / 'mine.py'}:Arms\n")
    monkeypatch.setattr(sys, "argv", ["golem", "run", str(tmp_path / "mine.yaml")])
    with pytest.raises(SystemExit) as end:
        cli.main()
    sentence, *trace = capsys.readouterr().err.splitlines()
    assert end.value.code == 2
    assert sentence.endswith("importing it raised ZeroDivisionError: division by zero (mine.py:2)")
    assert trace == [
        "Traceback (most recent call last):",
        f'  File "{tmp_path / "mine.py"}", line 2, in <module>',
        "    1 / 0",
        "ZeroDivisionError: division by zero",
    ]


def test_a_slow_module_is_told_in_one_line_and_other_warnings_as_ever(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def slow(words: list[str]) -> int:
        warnings.warn("arms take 50 ms", SlowModule, stacklevel=1)
        warnings.warn("something else", RuntimeWarning, stacklevel=1)
        return 0

    monkeypatch.setitem(cli.COMMANDS, "slow", slow)
    monkeypatch.setattr(sys, "argv", ["golem", "slow"])
    with warnings.catch_warnings(), pytest.raises(SystemExit):
        warnings.simplefilter("always")
        monkeypatch.setattr(cli, "_SHOW_WARNING", lambda message, *_: print(f"{message!r}", file=sys.stderr))
        cli.main()
    assert capsys.readouterr().err.splitlines() == ["golem: arms take 50 ms", "RuntimeWarning('something else')"]
