from __future__ import annotations

import json
import multiprocessing
import os
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tyro

from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation.harness import ladder
from golem.evaluation.harness.ladder import LadderConfig, LadderInterrupted, run_ladder
from golem.evaluation.harness.records import read_records

Make = Callable[..., LadderConfig]

SCRIPT = """
import signal, sys
from pathlib import Path
# A background job of a shell starts with Ctrl-C ignored, and so would this process if the tests run in one.
signal.signal(signal.SIGINT, signal.default_int_handler)
from golem.evaluation import base
from golem.evaluation.harness import ladder
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
ladder.code_digest = ladder.commit = lambda: "tested"
base.RUNGS["fake"] = "fake_rung:Fake"
if __name__ == "__main__":
    run_ladder(LadderConfig(rung="fake", method=("poor", "slow"), n=20, out=Path(sys.argv[1]), j=2))
"""


def content(config: LadderConfig) -> dict[str, bytes]:
    """The bytes of everything that must not depend on how the trials were run."""
    names = [
        "trials.jsonl",
        "summary.json",
        *(f"pictures/{p.name}" for p in (config.out / "pictures").iterdir()),
    ]
    return {name: (config.out / name).read_bytes() for name in names}


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


def test_a_finished_run_is_not_run_again_and_a_longer_one_continues_it(fake: Make) -> None:
    config = fake("good", n=3)
    run_ladder(config)
    written = content(config)
    run_ladder(config)
    assert content(config) == written
    assert len((config.out / "timings.jsonl").read_text().splitlines()) == 3
    run_ladder(replace(config, n=6))
    direct = fake("good", n=6, out="direct")
    run_ladder(direct)
    assert content(replace(config, n=6)) == content(direct)
    assert len((config.out / "timings.jsonl").read_text().splitlines()) == 6


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
    assert not config.out.exists()


def test_a_fault_of_the_rung_itself_is_shown_with_its_trace(fake: Make) -> None:
    with pytest.raises(RuntimeError, match=r"(?s)fault of its code.*no such body"):
        run_ladder(fake("buggy"))


def test_a_worker_that_dies_ends_the_run_with_one_sentence(fake: Make) -> None:
    before = set(multiprocessing.active_children())
    with pytest.raises(GolemError, match="A worker process died"):
        run_ladder(fake("deadly"))
    assert set(multiprocessing.active_children()) <= before


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"rung": "fak"}, "Unknown rung 'fak'; valid: .*Did you mean 'fake'"),
        ({"method": ("god",)}, "Unknown method 'god'; valid: .*Did you mean 'good'"),
        ({"method": ()}, "names no method; valid: .*good"),
        ({"method": ("good", "good")}, "names 'good' more than once"),
        ({"profile": "feld"}, "Unknown profile 'feld'; valid: field, ideal. Did you mean 'field'"),
        ({"n": 0}, "-n is 0; it must be 1 or more"),
        ({"n": -3}, "-n is -3"),
        ({"j": 0}, "-j is 0; it must be 1 or more"),
        ({"seed": -1}, "--seed is -1; it must be 0 or more"),
        ({"use": ("upper_body",)}, "--use 'upper_body' must read slot=implementation"),
        ({"use": ("uper=x",)}, "Unknown slot 'uper'"),
    ],
)
def test_bad_options_are_answered_in_one_sentence_before_anything_is_written(
    fake: Make, options: dict[str, Any], sentence: str
) -> None:
    config = replace(fake("good"), **options)
    with pytest.raises(ConfigError, match=sentence):
        run_ladder(config)
    assert not config.out.exists()


def test_an_unwritable_folder_is_refused(fake: Make, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("kept")
    with pytest.raises(OutputError, match="Cannot write to --out .*file"):
        run_ladder(fake("good", out="file"))
    assert (tmp_path / "file").read_text() == "kept"


def test_a_replaced_module_is_another_configuration(fake: Make) -> None:
    config = fake("good", n=2)
    run_ladder(config)
    written = content(config)
    with pytest.raises(OutputError, match="another overrides .*choose another --out"):
        run_ladder(replace(config, use=("upper_body=pink_ik",)))
    assert content(config) == written


def test_ctrl_c_keeps_what_finished_and_tells_the_command(
    fake: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = fake("good", n=5)
    finished = ladder._finished

    def stop_after_two(*arguments: Any) -> Iterator[Any]:
        for count, item in enumerate(finished(*arguments)):
            if count == 2:
                raise KeyboardInterrupt
            yield item

    with monkeypatch.context() as patch:
        patch.setattr(ladder, "_finished", stop_after_two)
        with pytest.raises(LadderInterrupted, match="2 of 5 trials") as stop:
            run_ladder(config)
    assert config.command() in str(stop.value)
    assert len(read_records(config.out / "trials.jsonl")) == 2
    run_ladder(config)
    whole = fake("good", n=5, out="whole")
    run_ladder(whole)
    assert content(config) == content(whole)


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_killed_run_leaves_no_process_and_continues_to_the_same_bytes(
    fake: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, how: int
) -> None:
    # Somebody may edit or commit the package between the two processes; that is another test's subject.
    monkeypatch.setattr(ladder, "code_digest", lambda: "tested")
    monkeypatch.setattr(ladder, "commit", lambda: "tested")
    script, config = tmp_path / "script.py", fake("poor", "slow", n=20, out="killed", j=2)
    script.write_text(SCRIPT)
    path = os.pathsep.join(sys.path)
    process = subprocess.Popen(
        [sys.executable, str(script), str(config.out)],
        env={**os.environ, "PYTHONPATH": path},
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    trials = config.out / "trials.jsonl"
    deadline = time.monotonic() + 60
    while not (trials.exists() and trials.read_bytes().count(b"\n") >= 2) and time.monotonic() < deadline:
        time.sleep(0.02)
    if how == signal.SIGINT:
        os.killpg(process.pid, how)  # as a terminal does: the workers get it too
    else:
        process.send_signal(how)
    _, errors = process.communicate(timeout=30)
    assert process.returncode != 0
    assert ("continue with: golem ladder" in errors) == (how == signal.SIGINT)
    assert "KeyboardInterrupt" not in errors, "a worker wrote a stack trace"
    while _alive(process.pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not _alive(process.pid)
    assert 2 <= len(read_records(trials)) < 40
    with trials.open("ab") as file:
        file.write(b'{"schema":1,"rung":"fa')
    run_ladder(config)
    whole = fake("poor", "slow", n=20, out="whole", j=2)
    run_ladder(whole)
    assert content(config) == content(whole)


def _alive(group: int) -> bool:
    """Whether a process of this group still runs."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


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
    config = fake("good", "poor", n=7, seed=3, j=2, use=("upper_body=my ik.py:MyIk",), json=True)
    words = shlex.split(config.command())
    assert words[:2] == ["golem", "ladder"]
    assert tyro.cli(LadderConfig, args=words[2:]) == config


def test_the_summary_line_says_what_a_script_needs(fake: Make) -> None:
    result = run_ladder(fake("poor", "faulty", n=20))
    line = result.summary.json()
    assert "\n" not in line
    poor = json.loads(line)["methods"]["poor"]
    won = sum(r.success for r in result.records if r.method == "poor")
    assert (poor["n"], poor["successes"]) == (20, won)
    assert sum(poor["failures_by_stage"].values()) == 20 - won
    assert poor["interval"][0] < won / 20 < poor["interval"][1]
    times = sorted(r.timings["detect_to_grasp"] for r in result.records if r.method == "poor" and r.timings)
    assert times[0] < poor["median_times"]["detect_to_grasp"] < times[-1]
    assert json.loads(line)["methods"]["faulty"]["failures_by_module"] == {"upper_body: my_ik.py:MyIk": 10}
    (pair,) = json.loads(line)["comparisons"]
    assert (pair["a"], pair["b"]) == ("poor", "faulty")
    assert json.loads((result.config.out / "summary.json").read_text()) == json.loads(line)
