from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from golem.errors import ConfigError, OutputError
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.harness.records import Provenance, TrialRecord, artefacts, read_records, trial_name
from golem.evaluation.harness.run_folder import Finished, RunFolder, finished_records, read_costs, read_facts

FACTS = {"config": {"stack": {"latency": 0.02}, "user_files": {"lower_body/use": 16 * "a"}}}
PROVENANCE = Provenance({"a": FACTS, "b": {}}, {"stack.py": 16 * "c"}, "commit", {"numpy": "2"})


def trial(method: str, index: int, picture: bytes | None = None) -> tuple[TrialRecord, Finished]:
    spec = TrialSpec("tether", method, "field", 0, index)
    outcome = TrialOutcome(
        False, "reach", "upper_body: diff_ik", "short", {"total": 2.5}, {"x": 1.0}, picture, costs={"tick": 0.5}
    )
    return PROVENANCE.record(spec, outcome), Finished(outcome, 3.0, 2.0, {"trace.npz": b"trace"})


def fill(folder: Path, *keys: tuple[str, int]) -> None:
    with RunFolder(folder) as run:
        run.state("golem ladder", PROVENANCE)
        for key in keys:
            run.append(*trial(*key))


def resume(
    folder: Path, provenance: Provenance = PROVENANCE, profile: str = "field", seed: int = 0
) -> list[TrialRecord]:
    with RunFolder(folder) as run:
        return run.resume(TrialSpec("tether", "a", profile, seed, 0), provenance)


def test_a_record_survives_its_line() -> None:
    record, _ = trial("a", 0)
    assert TrialRecord.parse(record.line()) == record
    assert record.line().count("\n") == 1


@pytest.mark.parametrize("change", [{"schema": 1}, {"extra": 1}, {"stage": ...}])
def test_a_line_of_another_schema_is_refused(change: dict[str, object]) -> None:
    data = {**json.loads(trial("a", 0)[0].line()), **change}
    line = json.dumps({name: value for name, value in data.items() if value is not ...})
    with pytest.raises(ValueError, match="record"):
        TrialRecord.parse(line)


def test_a_torn_last_line_is_cut_off_and_the_rest_kept(tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0), ("b", 0))
    trials = tmp_path / "trials.jsonl"
    trials.write_bytes(trials.read_bytes()[:-20])
    assert [(r.method, r.index) for r in resume(tmp_path)] == [("a", 0)]
    fill(tmp_path, ("b", 0))
    assert [(r.method, r.index) for r in read_records(trials)] == [("a", 0), ("b", 0)]


def test_a_broken_line_in_the_middle_is_an_error_that_names_it(tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0))
    trials = tmp_path / "trials.jsonl"
    trials.write_bytes(b"nonsense\n" + trials.read_bytes())
    with pytest.raises(OutputError, match=r"Line 1 of .*trials.jsonl"):
        resume(tmp_path)


@pytest.mark.parametrize(
    "change",
    [
        {"index": "3"}, {"index": -1}, {"index": True}, {"success": "yes"}, {"success": True}, {"method": None},
        {"case": "uphill"}, {"case": {"slope": [1]}}, {"options": None}, {"series": [1.0]}, {"series": {"x": "far"}},
        {"timings": {"total": float("nan")}}, {"picture": 3}, {"versions": "2"},
    ],
    ids=str,
)  # fmt: skip
def test_a_value_that_no_trial_has_is_refused_with_its_line(change: dict[str, object], tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0))
    trials = tmp_path / "trials.jsonl"
    trials.write_text(trials.read_text() + json.dumps({**json.loads(trial("b", 0)[0].line()), **change}) + "\n")
    for read in (read_records, lambda path: finished_records(path.parent)):
        with pytest.raises(OutputError, match=r"^Line 2 of .*trials.jsonl is a trial record .*; choose another folder"):
            read(trials)


def test_records_of_one_trial_count_once_or_not_at_all(tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0), ("b", 0))
    trials = tmp_path / "trials.jsonl"
    trials.write_text(2 * trials.read_text())
    with pytest.raises(OutputError, match="Line 3 of .* is the second record of trial 0 of a;"):
        read_records(trials)


def test_a_rung_that_is_no_more_is_named_with_those_that_are(tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0))
    trials = tmp_path / "trials.jsonl"
    trials.write_text(trials.read_text().replace("tether", "tehter"))
    with pytest.raises(ConfigError, match="Unknown rung of .*trials.jsonl 'tehter'; valid: .* mean 'tether'"):
        finished_records(tmp_path)


@pytest.mark.parametrize("line", ["{", "[]", "null", '{"cpu": 1}', '{"wall": "x", "cpu": 1}', "[" * 5000])
def test_times_that_are_none_are_named_by_their_line(line: str, tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0))
    times = tmp_path / "timings.jsonl"
    times.write_text(times.read_text() + line + "\n" + times.read_text())
    with pytest.raises(OutputError, match=r"^Line 2 of .*timings.jsonl says no times of a trial"):
        read_costs(tmp_path)


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "null", "3"])
def test_facts_that_are_none_count_as_absent(text: str, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(text)
    assert read_facts(tmp_path) == {}


def other(**config: object) -> dict[str, Any]:
    """Return the provenance of another configuration of method a."""
    return {"provenance": replace(PROVENANCE, facts={"a": {"config": {**FACTS["config"], **config}}})}


@pytest.mark.parametrize(
    ("what", "options"),
    [
        ("configuration.*config.stack.latency was 0.02 and is 0.04", other(stack={"latency": 0.04})),
        (
            "configuration.*: the content of your file for lower_body/use has changed",
            other(user_files={"lower_body/use": 16 * "b"}),
        ),
        ("code.*stack.py has changed", {"provenance": replace(PROVENANCE, files={"stack.py": 16 * "d"})}),
        ("package versions.*numpy was 2 and is 3", {"provenance": replace(PROVENANCE, versions={"numpy": "3"})}),
        ("profile.*profile was field and is ideal", {"profile": "ideal"}),
        ("seed.*seed was 0 and is 1", {"seed": 1}),
    ],
)
def test_trials_that_cannot_be_compared_are_not_mixed_and_what_differs_is_said(
    tmp_path: Path, what: str, options: dict[str, Any]
) -> None:
    fill(tmp_path, ("a", 0))
    before = (tmp_path / "trials.jsonl").read_bytes()
    with pytest.raises(OutputError, match=f"differ in {what}"):
        resume(tmp_path, **options)
    assert (tmp_path / "trials.jsonl").read_bytes() == before


def test_a_folder_of_an_older_golem_is_named_as_such(tmp_path: Path) -> None:
    (tmp_path / "trials.jsonl").write_text('{"schema":1,"rung":"tether"}\n')
    with pytest.raises(OutputError, match="schema 1, of another version of golem, which reads schema 2"):
        resume(tmp_path)


def test_another_commit_of_the_same_code_continues(tmp_path: Path) -> None:
    fill(tmp_path, ("a", 0))
    assert len(resume(tmp_path, replace(PROVENANCE, commit="docs-only"))) == 1


def test_finish_orders_by_trial_then_method(tmp_path: Path) -> None:
    with RunFolder(tmp_path) as run:
        records = [trial(*key)[0] for key in (("a", 1), ("b", 1), ("a", 0), ("b", 0))]
        run.finish(records, ("b", "a"))
    assert [(r.method, r.index) for r in read_records(tmp_path / "trials.jsonl")] == [
        ("b", 0),
        ("a", 0),
        ("b", 1),
        ("a", 1),
    ]


def test_costs_and_pictures_lie_beside_the_records(tmp_path: Path) -> None:
    record, finished = trial("a", 0, picture=b"png")
    with RunFolder(tmp_path) as run:
        run.append(record, finished)
    assert record.picture is not None
    assert (tmp_path / record.picture).read_bytes() == b"png"
    assert json.loads((tmp_path / "timings.jsonl").read_text()) == {
        "method": "a",
        "case": {},
        "index": 0,
        "wall": 3.0,
        "cpu": 2.0,
        "tick": 0.5,
    }
    assert "wall" not in record.line() and "tick" not in record.line()
    assert (artefacts(tmp_path, record) / "trace.npz").read_bytes() == b"trace"


def test_a_folder_has_one_writer(tmp_path: Path) -> None:
    with RunFolder(tmp_path), pytest.raises(OutputError, match="Another run is writing"):
        RunFolder(tmp_path)
    RunFolder(tmp_path).__exit__(None, None, None)


def test_a_folder_that_stays_empty_is_taken_away_again(tmp_path: Path) -> None:
    with RunFolder(tmp_path / "run"):
        assert (tmp_path / "run").is_dir()
    assert not (tmp_path / "run").exists()


def test_an_unwritable_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="Cannot write to --out"):
        RunFolder(tmp_path / "file" / "run")


def test_methods_have_files_of_their_own() -> None:
    names = {trial_name(TrialSpec("tether", method, "field", 0, 7)) for method in ("legs/v1.py:M", "legs_v1.py:M")}
    assert len(names) == 2 and all(name.endswith("-00007") and "/" not in name for name in names)
    assert trial_name(TrialSpec("tether", "centroid", "field", 0, 7)) == "centroid-00007"
    pushed = TrialSpec("push-limit", "almi", "bench", 0, 7, case={"direction": "front_left", "level": 2.5})
    assert trial_name(pushed) == "almi-front_left-2.5-00007"
