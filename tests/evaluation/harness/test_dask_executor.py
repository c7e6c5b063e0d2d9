"""Trials on a Dask cluster of real processes: the same bytes as here, whichever worker is killed."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from golem.errors import ConfigError, GolemError
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.harness.run_folder import RunFolder

distributed = pytest.importorskip("distributed", reason="the extra cluster is not installed")
pytestmark = pytest.mark.slow
Make = Callable[..., LadderConfig]


class Cluster:
    """A scheduler and its workers, each a process of its own."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.workers = folder, list[subprocess.Popen[str]]()
        self._scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        assert self._scheduler.stderr is not None
        for line in self._scheduler.stderr:
            found = re.search(r"Scheduler at:\s+(tcp://\S+)", line)
            if found:
                self.address = found[1]
                break
        threading.Thread(target=self._scheduler.stderr.read, daemon=True).start()

    def _start(self, *words: str, **environment: str) -> subprocess.Popen[str]:
        # As somebody on another machine does: what it imports, it finds by itself.
        paths = os.pathsep.join([*sys.path, environment.pop("first", "")])
        return subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_" + words[0], *words[1:]],
            env={**os.environ, "PYTHONPATH": paths, **environment},
            cwd=self.folder,
            stderr=subprocess.PIPE if words[0] == "scheduler" else subprocess.DEVNULL,
            text=True,
        )

    def add(self, **environment: str) -> subprocess.Popen[str]:
        """Start one more worker."""
        words = ("worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard")
        self.workers.append(self._start(*words, **environment))
        return self.workers[-1]

    def close(self) -> None:
        """End everything."""
        for process in (*self.workers, self._scheduler):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    made = Cluster(tmp_path)
    yield made
    made.close()


def content(out: Path | None) -> bytes:
    assert out is not None
    return (out / "trials.jsonl").read_bytes()


def test_records_are_those_of_two_processes_here_though_a_worker_is_killed(
    fake: Make, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = fake("poor", "slow", n=12, out="here", j=2)
    run_ladder(here)
    victim = cluster.add()
    cluster.add()
    append, kept = RunFolder.append, list[object]()

    def kill(self: RunFolder, *arguments: object) -> None:
        kept.append(append(self, *arguments))  # pyright: ignore[reportArgumentType]
        if len(kept) == 4:
            victim.send_signal(signal.SIGKILL)

    monkeypatch.setattr(RunFolder, "append", kill)
    there = fake("poor", "slow", n=12, out="there", executor=f"dask:{cluster.address}")
    run_ladder(there)
    assert victim.wait(timeout=10) == -signal.SIGKILL
    assert content(there.out) == content(here.out)


@pytest.mark.long
def test_a_trial_that_hangs_or_crashes_there_costs_itself(fake: Make, cluster: Cluster) -> None:
    cluster.add()
    for method, stage in (("endless", "timeout"), ("deadly", "crash")):
        config = fake(method, n=3, limit=3.0, out=method, executor=f"dask:{cluster.address}")
        assert [r.stage for r in run_ladder(config).records] == ["done", stage, "done"]


def test_a_worker_with_other_code_is_refused(fake: Make, cluster: Cluster, tmp_path: Path) -> None:
    import golem

    other = tmp_path / "other" / "golem"
    other.mkdir(parents=True)
    for entry in Path(golem.__path__[0]).iterdir():
        (other / entry.name).symlink_to(entry)
    (other / "changed.py").write_text("")
    cluster.add(PYTHONPATH=os.pathsep.join([str(other.parent), *sys.path]))
    with pytest.raises(GolemError, match="runs other code of golem"):
        run_ladder(fake("good", n=1, executor=f"dask:{cluster.address}"))


def test_an_address_where_nobody_answers_is_named(fake: Make) -> None:
    with pytest.raises(ConfigError, match="No Dask scheduler answers at tcp://127.0.0.1:1"):
        run_ladder(fake("good", n=1, executor="dask:tcp://127.0.0.1:1"))


def test_a_cluster_that_goes_away_ends_the_run_in_a_sentence(fake: Make, cluster: Cluster) -> None:
    cluster.add()
    timer = threading.Timer(6.0, cluster.close)
    timer.start()
    started = time.monotonic()
    with pytest.raises(GolemError, match="cluster cannot go on.*same command"):
        run_ladder(fake("slow", n=2000, executor=f"dask:{cluster.address}"))
    assert time.monotonic() - started < 100.0
