from __future__ import annotations

import contextlib
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from tests.evaluation.fake_rung import FakeOptions

from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation.harness.ladder import LadderConfig, LadderInterrupted, read_ladder, run_ladder
from golem.evaluation.harness.records import read_records
from golem.evaluation.harness.run_folder import RunFolder

Make = Callable[..., LadderConfig]

SCRIPT = """
import signal, sys
from pathlib import Path
# A background job of a shell starts with Ctrl-C ignored, and so would this process if the tests run in one.
signal.signal(signal.SIGINT, signal.default_int_handler)
from golem.evaluation import base
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
base.RUNGS["fake"] = "tests.evaluation.fake_rung:Fake"
run_ladder(LadderConfig(rung="fake", method=("poor", "slow"), n=20, out=Path(sys.argv[1]), j=2))
"""


def folder(config: LadderConfig) -> Path:
    assert config.out is not None
    return config.out


def content(config: LadderConfig) -> dict[str, bytes]:
    """The bytes of everything that must not depend on how the trials were run."""
    out = folder(config)
    pictures = out / "pictures"
    names = [f"pictures/{p.name}" for p in pictures.iterdir()] if pictures.is_dir() else []
    return {name: (out / name).read_bytes() for name in ("trials.jsonl", "summary.json", *names)}


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bytes_whatever_the_number_of_processes(fake: Make) -> None:
    one, two = fake("poor", "good", "faulty", out="one"), fake("poor", "good", "faulty", out="two", j=2)
    run_ladder(one)
    run_ladder(two)
    assert content(one) == content(two)


def test_another_seed_gives_other_trials(fake: Make) -> None:
    one, two = run_ladder(fake("poor", out="one")), run_ladder(fake("poor", out="two", seed=1))
    assert [r.series for r in one.records] != [r.series for r in two.records]


def test_every_method_meets_the_same_scenes(fake: Make) -> None:
    result = run_ladder(fake("poor", "good", n=8))
    scenes = {m: [r.series["difficulty"] for r in result.records if r.method == m] for m in ("poor", "good")}
    assert scenes["poor"] == scenes["good"]
    assert len(set(scenes["poor"])) == 8


@pytest.mark.slow
def test_a_finished_run_is_not_run_again_and_a_longer_one_continues_it(fake: Make) -> None:
    config = fake("good", n=3)
    run_ladder(config)
    written = content(config)
    run_ladder(config)
    assert content(config) == written
    assert len((folder(config) / "timings.jsonl").read_text().splitlines()) == 3
    run_ladder(replace(config, n=6))
    direct = fake("good", n=6, out="direct")
    run_ladder(direct)
    assert content(replace(config, n=6)) == content(direct)
    assert len((folder(config) / "timings.jsonl").read_text().splitlines()) == 6


def test_a_module_that_breaks_its_contract_loses_its_trials_and_no_others(fake: Make) -> None:
    result = run_ladder(fake("faulty", n=4))
    assert [r.success for r in result.records] == [True, False, True, False]
    lost = result.records[1]
    assert (lost.stage, lost.module) == ("fault", "upper_body: my_ik.py:MyIk")
    assert lost.detail == "joint targets have shape (14,), not (15,)"


def test_what_the_rung_needs_and_the_machine_lacks_ends_the_run_with_nothing_written(fake: Make) -> None:
    config = fake("keyless")
    with pytest.raises(GolemError, match=r"golem-humanoid\[plan\]"):
        run_ladder(config)
    assert not folder(config).exists()


def test_a_fault_of_the_rung_itself_is_shown_with_its_trace(fake: Make) -> None:
    with pytest.raises(RuntimeError, match=r"(?s)fault of its code.*no such body"):
        run_ladder(fake("buggy"))


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"rung": "fak"}, "Unknown rung 'fak'; valid: .*Did you mean 'fake'"),
        ({"method": ("god",)}, "Unknown method 'god'; valid: .*Did you mean 'good'"),
        ({"method": ("good", "good")}, "names 'good' more than once"),
        ({"profile": "feld"}, "Unknown profile 'feld'; valid: field, ideal. Did you mean 'field'"),
        ({"n": 0}, "-n is 0; it must be 1 or more"),
        ({"n": -3}, "-n is -3"),
        ({"j": 0}, "-j is 0; it must be 1 or more"),
        ({"seed": -1}, "--seed is -1; it must be 0 or more"),
        ({"use": ("upper_body",)}, "--use 'upper_body' must read slot=implementation"),
        ({"use": ("uper=x",)}, "Unknown slot 'uper'"),
        ({"limit": 0.0}, "--limit is 0; it must be more than 0"),
        ({"executor": "slurm"}, "--executor is 'local' or 'dask:ADDRESS'"),
    ],
)
def test_bad_options_are_answered_in_one_sentence_before_anything_is_written(
    fake: Make, options: dict[str, Any], sentence: str
) -> None:
    config = replace(fake("good"), **options)
    with pytest.raises(ConfigError, match=sentence):
        run_ladder(config)
    assert not folder(config).exists()


def test_an_unwritable_folder_is_refused(fake: Make, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OutputError, match="Cannot write to --out .*file"):
        run_ladder(fake("good", out="file"))
    assert (tmp_path / "file").read_text() == "kept"


def test_a_replaced_module_is_another_configuration(fake: Make) -> None:
    config = fake("good", n=2)
    run_ladder(config)
    written = content(config)
    with pytest.raises(OutputError, match="differ in overrides.*upper_body was absent and is pink_ik"):
        run_ladder(replace(config, use=("upper_body=pink_ik",)))
    with pytest.raises(OutputError, match="differ in options.*options.skill was 1.0 and is 0.5"):
        run_ladder(replace(config, options=FakeOptions(skill=0.5)))
    assert content(config) == written


@pytest.mark.slow
def test_ctrl_c_keeps_what_finished_and_tells_the_command(fake: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    config = fake("good", n=5)
    append, kept = RunFolder.append, []

    def stop_after_two(self: RunFolder, *arguments: Any) -> None:
        if len(kept) == 2:
            raise KeyboardInterrupt
        kept.append(append(self, *arguments))

    with monkeypatch.context() as patch:
        patch.setattr(RunFolder, "append", stop_after_two)
        with pytest.raises(LadderInterrupted, match="2 trials kept") as stop:
            run_ladder(config)
    assert config.command() in str(stop.value)
    assert len(read_records(folder(config) / "trials.jsonl")) == 2
    run_ladder(config)
    whole = fake("good", n=5, out="whole")
    run_ladder(whole)
    assert content(config) == content(whole)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/environ").exists(), reason="no /proc here")
@pytest.mark.parametrize(
    "how", [signal.SIGKILL, *(pytest.param(how, marks=pytest.mark.long) for how in (signal.SIGINT, signal.SIGTERM))]
)
def test_a_killed_run_leaves_no_process_and_continues_to_the_same_bytes(fake: Make, tmp_path: Path, how: int) -> None:
    script, config = tmp_path / "script.py", fake("poor", "slow", n=20, out="killed", j=2)
    script.write_text(SCRIPT)
    path = os.pathsep.join(sys.path)
    process = subprocess.Popen(
        [sys.executable, str(script), str(folder(config))],
        env={**os.environ, "PYTHONPATH": path, "GOLEM_TEST": str(folder(config))},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    trials = folder(config) / "trials.jsonl"
    deadline = time.monotonic() + 60
    while not (trials.exists() and trials.read_bytes().count(b"\n") >= 2) and time.monotonic() < deadline:
        time.sleep(0.02)
    if how == signal.SIGINT:
        os.killpg(process.pid, how)  # as a terminal does: the workers get it too
    else:
        process.send_signal(how)
    _, errors = process.communicate(timeout=30)
    assert process.returncode != 0
    assert ("continue with: golem ladder" in errors) == (how != signal.SIGKILL)
    assert "leaked" not in errors and errors.count("Traceback") <= 1, errors
    while workers(folder(config)) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not workers(folder(config))
    assert 2 <= len(read_records(trials)) < 40
    with trials.open("ab") as file:
        file.write(b'{"schema":2,"rung":"fa')
    run_ladder(config)
    whole = fake("poor", "slow", n=20, out="whole", j=2)
    run_ladder(whole)
    assert content(config) == content(whole)


def workers(out: Path) -> list[int]:
    """The processes that were started for this run, or by what was; each inherits the mark in its environment."""
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                if f"GOLEM_TEST={out}".encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
    return found


def test_workers_compute_in_one_thread_and_the_parents_environment_comes_back(
    fake: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    result = run_ladder(fake("threads", n=1))
    assert result.records[0].series == {"threads": 1.0}
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ


def test_the_command_line_that_a_run_names_is_the_one_that_makes_it(fake: Make) -> None:
    options = FakeOptions(skill=0.5)
    config = fake("good", "poor", n=7, seed=3, j=2, use=("upper_body=my ik.py:MyIk",), json=True, options=options)
    words = shlex.split(config.command())
    assert words[:2] == ["golem", "ladder"]
    again = read_ladder(words[2:])
    assert all(getattr(again, f.name) == getattr(config.whole(), f.name) for f in fields(LadderConfig))


def test_the_summary_line_says_what_a_script_needs(fake: Make) -> None:
    result = run_ladder(fake("poor", "faulty", n=20))
    line = result.summary.json()
    assert "\n" not in line
    poor, faulty = json.loads(line)["rows"]
    won = sum(r.success for r in result.records if r.method == "poor")
    assert (poor["method"], poor["n"], poor["successes"]) == ("poor", 20, won)
    assert sum(poor["stages"].values()) == 20 - won
    assert poor["interval"]["low"] < won / 20 < poor["interval"]["high"]
    times = sorted(r.timings["detect_to_grasp"] for r in result.records if r.method == "poor" and r.timings)
    assert times[0] < poor["times"]["detect_to_grasp"]["median"] < times[-1]
    assert faulty["modules"] == {"upper_body: my_ik.py:MyIk": 10}
    (pair,) = json.loads(line)["comparisons"]
    assert (pair["a"], pair["b"]) == ("poor", "faulty")
    assert json.loads((result.out / "summary.json").read_text()) == json.loads(line)


@pytest.mark.slow
def test_an_adaptive_rung_goes_where_the_results_lead(fake: Make) -> None:
    one, two = fake(rung="climb", n=3, out="one"), fake(rung="climb", n=3, out="two", j=2)
    result = run_ladder(one)
    run_ladder(two)
    assert content(one) == content(two)
    levels = {(r.method, r.case["level"]) for r in result.records if r.case["side"] == "left"}
    assert levels == {("weak", x) for x in (1.0, 2.0, 3.0)} | {("strong", x) for x in (1.0, 2.0, 3.0, 4.0)}
    assert len(result.records) == 2 * 3 * 7
    torn = folder(one) / "trials.jsonl"
    torn.write_bytes(b"".join(torn.read_bytes().splitlines(keepends=True)[:10]))
    run_ladder(one)
    assert content(one) == content(two)


def test_help_lists_the_rungs_and_what_each_can_be_told(fake: Make, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        read_ladder(["--rung", "fake", "--help"])
    said = capsys.readouterr().out
    assert "visual_servo, or yours" in said and "climb" in said and "Pick a screw" in said
    assert "--skill FLOAT" in said


def test_help_imports_every_rung_and_needs_no_extra() -> None:
    absent = ("mcap", "cyclonedds", "dask", "viser", "matplotlib", "mcp", "pyarrow", "gymnasium")
    code = f"""
import sys
sys.modules.update(dict.fromkeys({absent!r}))
from golem.evaluation.harness.ladder import read_ladder
read_ladder(["--rung", "tether"])
"""
    subprocess.run([sys.executable, "-c", code], check=True)
