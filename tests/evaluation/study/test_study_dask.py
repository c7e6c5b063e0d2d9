"""A study on a Dask cluster of two workers of which one is killed: the same bytes as here with two processes."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("distributed", reason="the extra cluster is not installed")
pytest.importorskip("jinja2", reason="the extra report is not installed")

from tests.evaluation.harness.test_dask_executor import Cluster  # noqa: E402

from golem.evaluation.harness.ladder import LadderConfig  # noqa: E402
from golem.evaluation.harness.run_folder import RunFolder  # noqa: E402
from golem.evaluation.study.study_command import StudyConfig, run_study_command  # noqa: E402

pytestmark = pytest.mark.slow
FILE = """
title: Slow and poor
n: 24
stop: decided
cells:
  - {rung: fake, method: [poor, slow], profile: [ideal, field]}
"""


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    made.close()


def test_a_study_on_a_cluster_has_the_records_of_two_processes_though_a_worker_is_killed(
    fake: Callable[..., LadderConfig], cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pair.yaml").write_text(FILE)
    here = StudyConfig((tmp_path / "pair.yaml",), out=tmp_path / "here", j=2)
    run_study_command(here)
    victim = cluster.add()
    cluster.add()
    append, kept = RunFolder.append, list[object]()

    def kill(self: RunFolder, *arguments: object) -> None:
        kept.append(append(self, *arguments))  # pyright: ignore[reportArgumentType]
        if len(kept) == 3:
            victim.send_signal(signal.SIGKILL)

    monkeypatch.setattr(RunFolder, "append", kill)
    run_study_command(replace(here, out=tmp_path / "there", j=1, executor=f"dask:{cluster.address}"))
    assert victim.wait(timeout=10) == -signal.SIGKILL
    for cell in ("fake-ideal", "fake-field"):
        records = [(tmp_path / where / cell / "trials.jsonl").read_bytes() for where in ("here", "there")]
        assert records[0] == records[1] and 20 < records[0].count(b"\n") < 48
