"""Jobs are run once, kept, followed up, and never mixed with those of other code."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest

from golem.errors import ConfigError, GolemError, OutputError
from golem.evaluation import campaign
from golem.evaluation.campaign import Job, Result, run_campaign
from golem.provenance import Unchanged


@dataclass(frozen=True)
class Count:
    """Counts how often it is run."""

    number: int
    log: str

    def run(self) -> Result:
        if self.number == 13:
            raise ConfigError("Thirteen is unlucky; choose another.")
        with open(self.log, "a", encoding="utf-8") as file:
            file.write(f"{self.number}\n")
        return {"double": 2 * self.number}


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return tmp_path / "log"


def test_a_campaign_runs_what_follows_and_continues_where_it_stopped(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def then(job: Job, result: Result) -> Iterable[Job]:
        assert isinstance(job, Count)
        return [Count(result["double"], job.log)] if job.number < 4 else []

    # Somebody may edit the package while this runs; that is what the last lines are about.
    monkeypatch.setattr(campaign, "code_digest", lambda: "tested")
    out = tmp_path / "run"
    first = run_campaign(out, [Count(1, str(log))], 1, then)
    assert sorted(done.result["double"] for done in first) == [2, 4, 8]
    lines = (out / "jobs.jsonl").read_text().splitlines()
    (out / "jobs.jsonl").write_text("\n".join(lines[:2]) + "\n" + lines[2][:20])
    again = run_campaign(out, [Count(1, str(log))], 1, then)
    assert again == first
    assert log.read_text().split() == ["1", "2", "4", "4"], "what was kept is not run again"
    monkeypatch.setattr(campaign, "code_digest", lambda: "changed")
    with pytest.raises(OutputError, match="other code"):
        run_campaign(out, [Count(1, str(log))], 1)


def test_what_a_user_can_cause_comes_back_as_a_sentence(tmp_path: Path, log: Path) -> None:
    with pytest.raises(GolemError, match="Thirteen"):
        run_campaign(tmp_path / "run", [Count(13, str(log))], 1)
    with pytest.raises(ConfigError, match="-j is 0"):
        run_campaign(tmp_path / "run", [], 0)


def test_a_file_that_holds_no_jobs_is_refused(tmp_path: Path, log: Path) -> None:
    (tmp_path / "jobs.jsonl").write_text(json.dumps({"something": "else"}) + "\n")
    with pytest.raises(OutputError, match="Line 1"):
        run_campaign(tmp_path, [Count(1, str(log))], 1)


@dataclass(frozen=True)
class Die:
    """Takes its process with it."""

    number: int

    def run(self) -> Result:
        if self.number:
            time.sleep(0.2)
            os._exit(9)
        return {}


def test_a_worker_that_dies_is_a_sentence_wherever_it_is_noticed(tmp_path: Path) -> None:
    def then(job: Job, result: Result) -> Iterable[Job]:
        time.sleep(1.0)  # the other worker dies meanwhile
        return [Die(0)]

    with pytest.raises(GolemError, match="A worker process died"):
        run_campaign(tmp_path / "run", [Die(0), Die(1)], 2, then)


def test_results_of_code_that_changed_meanwhile_are_not_kept(
    tmp_path: Path, log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stamps = iter([(1, 1), (1, 2)])
    monkeypatch.setattr(Unchanged, "_now", staticmethod(lambda: next(stamps)))
    with pytest.raises(OutputError, match="changed while this ran"):
        run_campaign(tmp_path / "run", [Count(1, str(log))], 1)
    assert not (tmp_path / "run" / "jobs.jsonl").exists()


def test_a_file_of_results_that_cannot_be_read_is_a_sentence(tmp_path: Path, log: Path) -> None:
    (tmp_path / "jobs.jsonl").mkdir()
    with pytest.raises(OutputError, match="Cannot write to"):
        run_campaign(tmp_path, [Count(1, str(log))], 1)
