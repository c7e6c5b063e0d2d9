from __future__ import annotations

import json
import time
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

from golem.errors import GolemError
from golem.evaluation.harness.records import SCHEMA, TrialRecord
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.real.real_command import RealConfig, RealRow, compared, predicted, read_real, run_real

HEAD = "rung,method,case,metric,stat,n,value,sd,index,source\n"


def record(index: int, success: bool, rung: str = "tether", profile: str = "field", **series: float) -> TrialRecord:
    return TrialRecord(
        SCHEMA, rung, "visual_servo", profile, 0, index, {}, {}, {}, "c", "0", "x", {}, success,
        "done" if success else "grasp", None, "", {}, series, None, None,
    )  # fmt: skip


def written(folder: Path, records: list[TrialRecord]) -> Path:
    folder.mkdir()
    (folder / "trials.jsonl").write_text("".join(json.dumps(asdict(r)) + "\n" for r in records))
    return folder


def test_the_papers_rows_are_those_of_its_published_rates() -> None:
    counts = {(r.rung, r.method): (r.value, r.n) for r in read_real("paper") if r.stat == "count"}
    for key, figures in PAPER.items():
        for figure in figures:
            if figure.label.endswith("real robot") and key[0] != "push-ramp":
                assert counts[key] == (figure.successes, figure.n), key


def test_the_template_is_a_valid_csv(tmp_path: Path) -> None:
    run_real(RealConfig(template=tmp_path / "mine.csv"))
    assert {row.stat for row in read_real(str(tmp_path / "mine.csv"))} == {"count", "trial", "mean", "median"}


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("tether,visual_servo,,success,count,30,31,,,", "31 of 30 successes"),
        ("tether,visual_servo,,success,count,30,2.5,,,", "2.5 of 30 successes"),
        ("tether,visual_servo,,success,count,30,-1,,,", "-1 of 30"),
        ("tether,visual_servo,,success,count,,3,,,", "'n' has no default"),
        ("tether,visual_servo,,success,trial,5,3,,,", "n is a number from 1 to a million, 1 of a trial"),
        ("tether,visual_servo,,success,count,30,,,,", "'value' has no default"),
        ("tether,visual_servo,,success,trial,,0.5,,,", "0.5 of 1"),
        ("tether,visual_servo,,success,mean,30,1,,,", "count or trial"),
        ("tether,visual_servo,,sway,count,30,1,,,", "mean or median"),
        ("tether,visual_servo,,sway,mode,30,1,,,", "mean"),
        ("tether,visual_servo,,sway,mean,30,x,,,", "a number"),
        ("tether,visual_servo,,sway,mean,30,.nan,,,", "NaN or infinity"),
        ("tether,visual_servo,,sway,mean,30,1e400,,,", "NaN or infinity|a number"),
        ("tether,visual_servo,,sway,mean,1,1,0.1,,", "an sd is above 0"),
        ("tether,visual_servo,,sway,mean,30,1,,3,", "only a trial has an index"),
        ("tether,visual_servo,,success,trial,,1,,-3,", "none below 0"),
        ("tether,visual_servo,,success,count,99999999999,1,,,", "million"),
        ("tethr,visual_servo,,success,count,30,3,,,", "Did you mean 'tether'"),
        ("tether,visual_serv,,success,count,30,3,,,", "Did you mean 'visual_servo'"),
        ("tether,visual_servo,,success,count,30,3,,,source,more", "more cells than columns"),
        ('tether,visual_servo,,success,count,30,3,,,"open', "cannot be read as CSV"),
    ],
)
def test_a_line_that_cannot_be_is_refused_in_one_sentence(tmp_path: Path, line: str, words: str) -> None:
    (tmp_path / "real.csv").write_text(HEAD + line + "\n")
    with pytest.raises(GolemError, match=words) as refusal:
        read_real(str(tmp_path / "real.csv"))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "has no line of trials"),
        (HEAD, "has no line of trials"),
        ("rung,method,stat,value\ntether,visual_servo,count,3\n", "'metric' has no default"),
        *(
            (HEAD.strip() + more + "\ntether,visual_servo,,success,count,30,3,,,,1\n", "it names case, .*, each once")
            for more in (",luck", ",n", ",")
        ),
        *(
            (HEAD.replace(",", mark) + "tether\n", "^The first line of .* is 'rung.*'; it names .* with commas between")
            for mark in (";", "\t", " | ")
        ),
        (HEAD.upper() + "tether\n", "^The first line of .* is 'RUNG, "),
    ],
)
def test_a_file_without_its_columns_is_refused(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "real.csv").write_text(text)
    with pytest.raises(GolemError, match=words):
        read_real(str(tmp_path / "real.csv"))
    with pytest.raises(GolemError, match="cannot be read"):
        read_real(str(tmp_path / "absent.csv"))
    (tmp_path / "real.csv").write_bytes(b"\xff\xfe\x00r")
    with pytest.raises(GolemError, match="cannot be read"):
        read_real(str(tmp_path / "real.csv"))


def test_a_csv_as_spreadsheets_write_it_and_a_long_one_are_read_at_once(tmp_path: Path) -> None:
    row = "tether, visual_servo, , success, trial, , 1, , , x\r\n"
    path = tmp_path / "real.csv"
    path.write_text("\ufeff" + HEAD.strip().replace(",", ", ") + "\r\n" + row * 1000 + ",,,,,,,,,\r\n", "utf-8")
    begun = time.process_time()
    assert read_real(str(path)) == [RealRow("tether", "visual_servo", "success", "trial", 1.0, 1, source="x")] * 1000
    assert run_real(RealConfig(str(path))) == 1
    assert time.process_time() - begun < 30.0  # [own] a rung made for each line takes minutes


def test_runs_that_are_none_or_of_two_profiles_are_refused(tmp_path: Path) -> None:
    with pytest.raises(GolemError, match="holds no trials"):
        run_real(RealConfig(runs=(tmp_path,)))
    runs = (written(tmp_path / "a", [record(0, True)]), written(tmp_path / "b", [record(0, True, profile="ideal")]))
    with pytest.raises(GolemError, match="field and ideal"):
        run_real(RealConfig(runs=runs))
    with pytest.raises(GolemError, match="Trial 0 of 'visual_servo' is in .*: give each run once"):
        run_real(RealConfig(runs=(runs[0], tmp_path / "b" / ".." / "a")))
    half = tmp_path / "a" / "trials.jsonl"
    half.write_text(half.read_text()[:50] + "\n")
    with pytest.raises(GolemError, match="Line 1"):
        run_real(RealConfig(runs=runs[:1]))


def count(value: float, n: int = 30) -> RealRow:
    return RealRow("tether", "visual_servo", "success", "count", value, n)


def test_a_predictive_interval_covers_what_the_twin_is() -> None:
    rng, inside = np.random.default_rng(0), 0
    for _ in range(300):
        twin = (rng.random(100) < 0.8).astype(float).tolist()
        span = predicted(count(0), twin)
        assert span is not None
        inside += span.low <= rng.binomial(30, 0.8) <= span.high
    assert inside >= 0.94 * 300
    for stat in ("mean", "median"):
        row, inside = RealRow("stand", "visual_servo", "sway", stat, 0.0, 20), 0  # pyright: ignore[reportArgumentType]
        for _ in range(200):
            span = predicted(row, rng.normal(size=60).tolist())
            assert span is not None
            inside += span.low <= float(getattr(np, stat)(rng.normal(size=20))) <= span.high
        assert 0.88 * 200 <= inside <= 200
    assert predicted(RealRow("stand", "visual_servo", "sway", "mean", 0.0, 20), [1.0]) is None


def test_verdicts_say_on_which_side_reality_is() -> None:
    twins = [record(i, i % 10 > 0, sway=0.001 + 1e-5 * (i % 7)) for i in range(100)]
    assert compared(count(27), [], twins)[7] == "predicted"
    assert compared(count(10), [], twins)[7] == "below the twin"
    sway = RealRow("tether", "visual_servo", "sway", "mean", 0.0046, 30)
    assert compared(sway, [], twins)[7] == "above the twin"
    other = RealRow("stand", "visual_servo", "sway", "mean", 0.0046, 30)
    assert compared(other, [], twins)[7] == "no trials of the twin"


def test_single_trials_that_repeat_the_twins_are_worth_more(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = written(tmp_path / "run", [record(i, i % 4 > 0) for i in range(200)])
    lines = [f"tether,visual_servo,,success,trial,,{int(i % 4 > 0) if i else 1},,{i}," for i in range(40)]
    (tmp_path / "real.csv").write_text(HEAD + "\n".join(lines) + "\n")
    assert run_real(RealConfig(str(tmp_path / "real.csv"), (run,))) == 1
    said = capsys.readouterr().out
    assert "31 of 40" in said and "predicted" in said
    row = count(31, 40)
    singles = read_real(str(tmp_path / "real.csv"))
    both = compared(row, singles, [record(i, i % 4 > 0) for i in range(200)])[-1]
    assert int(both.rpartition(", ")[2]) > 80
    # One that repeats none: the twin says nothing about it.
    (tmp_path / "real.csv").write_text(HEAD + "\n".join([*lines[1:], "tether,visual_servo,,success,trial,,1,,,"]))
    assert compared(row, read_real(str(tmp_path / "real.csv")), [record(i, True) for i in range(200)])[-1] == "-"
