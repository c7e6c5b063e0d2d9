from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.evaluation.blame.blamed_rung import Blamed

from golem.cli import main
from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation import base
from golem.evaluation.base import TrialOutcome, TrialSpec
from golem.evaluation.blame.blame_command import BlameConfig, run_blame
from golem.evaluation.harness.ladder import LadderConfig, run_ladder


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The run folder of a finished ladder of the three methods, and of its blame."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setitem(base.RUNGS, "blamed", "tests.evaluation.blame.blamed_rung:Blamed")
        # In this process: a worker would not know the rung. What is written need not reach the disk.
        monkeypatch.setattr("golem.evaluation.harness.ladder.make_executor", lambda *_: InProcess())
        monkeypatch.setattr("golem.evaluation.blame.blame_command.make_executor", lambda *_: InProcess())
        monkeypatch.setattr("os.fsync", lambda _: None)
        run = tmp_path_factory.mktemp("blame") / "run"
        run_ladder(LadderConfig("blamed", ("one", "both", "sound"), 60, "field", out=run))
        run_blame(BlameConfig((run,)))
        yield run


@pytest.fixture
def run(finished: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    return Path(shutil.copytree(finished, tmp_path / "run"))


class InProcess:
    """Runs batches here."""

    ran = 0

    def __init__(self) -> None:
        self._batches: list[object] = []

    def submit(self, batch: object) -> None:
        self._batches.append(batch)

    def results(self) -> object:
        from golem.evaluation.harness.trials import run_batch

        while self._batches:
            batch = self._batches.pop(0)
            InProcess.ran += 1
            yield batch, run_batch(batch)  # pyright: ignore[reportArgumentType]

    def close(self) -> None:
        pass


def test_the_module_that_lost_trials_is_named(run: Path) -> None:
    one, both, sound = json.loads((run / "blame" / "blame.json").read_text())
    assert one["first"] == "arms" and one["proved"] == ["arms"]
    # 20 of 60 trials are the arms', 10 nobody's.
    value = one["singles"]["arms"][2]
    assert value["value"] == pytest.approx(20 / 60)
    assert value["interval"]["low"] > 0.1 and value["interval"]["high"] < 0.5
    assert one["all_wins"] == 20 and len(one["strata"]["lost_run"]) == 30
    assert one["singles"]["head"][2]["value"] == 0.0 and one["singles"]["hand"][2]["value"] == 0.0
    # Two that lose the same trials together win nothing alone, and share what they win.
    assert both["proved"] == [] and both["singles"]["arms"][2]["value"] == 0.0
    assert {name: round(p["value"], 6) for name, p in both["shares"].items()} == {
        "head": round(1 / 6, 6),
        "arms": round(1 / 6, 6),
    }
    assert both["pairs"]["head+arms"]["value"] == pytest.approx(1 / 3)
    assert sound["first"] is None and sound["proved"] == [] and sound["shares"] == {}


def test_trials_are_not_run_twice_and_shares_sum_to_the_whole(run: Path) -> None:
    before = InProcess.ran
    assert run_blame(BlameConfig((run,))) == 3
    assert InProcess.ran == before
    for verdict in json.loads((run / "blame" / "blame.json").read_text()):
        total = sum(p["value"] for p in verdict["shares"].values())
        assert total == pytest.approx(verdict["total"]["value"])


def test_an_exchange_that_harms_is_charged_for_it(run: Path) -> None:
    run_blame(BlameConfig((run,), only=("arms", "hand"), harm=100))
    one = json.loads((run / "blame" / "blame.json").read_text())[0]
    # `hand` wins nothing, so that its harm is not even looked at; with everything exchanged it costs.
    assert one["singles"]["hand"][1] == -1 and "hand" not in one["shares"]


def test_harm_is_counted_among_the_trials_that_are_asked_for(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Blamed, "run", harmful)
    shutil.rmtree(run / "blame")
    for harm, lost in ((100, 10), (6, 2)):  # the second finds the trials of the first, and asks for every fifth
        run_blame(BlameConfig((run,), only=("arms",), harm=harm))
        one = json.loads((run / "blame" / "blame.json").read_text())[0]
        assert one["singles"]["arms"][1] == lost, harm


def harmful(self: Blamed, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
    """Arms win what they lost, and lose the third of six trials."""
    if spec.index % 6 == 2 if spec.overrides else spec.index % 6 < 2:
        return TrialOutcome(False, "reach", "upper_body: diff_ik")
    return TrialOutcome(True, "done")


def test_a_method_that_has_changed_since_is_refused(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a file of the user's that was mended after its ladder: the lost trials are no longer its own."""
    monkeypatch.setattr(Blamed, "config", lambda self, method, *_: {"file": "mended"} if method == "both" else {})
    with pytest.raises(ConfigError, match="both has changed since"):
        run_blame(BlameConfig((run,)))


def test_a_budget_names_every_rung(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_blame(BlameConfig((run, run), n=60))
    assert "Error budget" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("config", "words"),
    [({"only": ("arm",)}, "arms"), ({"only": ("sway",)}, "would exchange nothing"), ({"n": 0}, "-n is 1 or more")],
)
def test_what_cannot_be_is_refused_in_one_sentence(run: Path, config: dict[str, object], words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        run_blame(BlameConfig((run,), **config))  # pyright: ignore[reportArgumentType]


def test_a_folder_that_is_no_run_of_this_code_is_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="holds no trials"):
        run_blame(BlameConfig((tmp_path / "nowhere",)))
    records = run / "trials.jsonl"
    lines = records.read_text().splitlines()
    records.write_text("\n".join(line.replace('"code":"', '"code":"0') for line in lines) + "\n")
    with pytest.raises(ConfigError, match="other code"):
        run_blame(BlameConfig((run,)))
    records.write_text(lines[0] + "\n" + lines[1][:40] + "\n" + lines[2] + "\n")
    with pytest.raises(OutputError, match="Line 2"):
        run_blame(BlameConfig((run,)))
    records.write_text(lines[0].replace('"rung":"blamed"', '"rung":"blame"') + "\n")
    with pytest.raises(GolemError, match="Unknown rung"):
        run_blame(BlameConfig((run,)))


def test_the_command_refuses_in_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setattr("sys.argv", ["golem", "blame", str(tmp_path)])
    with pytest.raises(SystemExit, match="2"):
        main()
    assert capsys.readouterr().err.count("\n") == 1
