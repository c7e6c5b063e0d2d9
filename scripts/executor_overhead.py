"""Measures what running a trial costs beside the trial, and how many tasks a Dask scheduler hands out.

    python scripts/executor_overhead.py --trials 200 --workers 64 --tasks 2000

First: CPU time of runner and worker for a trial that does nothing, by the difference of two runs. Then: tasks per
second of a scheduler with simulated workers (threads of this process, tasks that do nothing), with a study's batches.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))  # workers find this file by the path of their parent

from golem.evaluation.base import RUNGS, Rung, TrialOutcome, TrialSpec  # noqa: E402
from golem.evaluation.harness.ladder import LadderConfig, prepare, run_ladder  # noqa: E402
from golem.evaluation.harness.run_folder import read_costs  # noqa: E402
from golem.evaluation.harness.trials import Batch  # noqa: E402


class Nothing(Rung[Any]):
    """Succeed at once."""

    name = "nothing"
    default_methods = ("none",)

    def methods(self) -> tuple[str, ...]:
        """Return the only one."""
        return self.default_methods

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return nothing."""
        return {}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Succeed."""
        return TrialOutcome(True, "done")


def cpu() -> float:
    """Return CPU time of this process and of its workers that have ended [s]."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def overhead(trials: int) -> float:
    """Return CPU time per trial that is not the trial's [s]."""
    costs = list[float]()
    for n in (1, 1 + trials):
        with tempfile.TemporaryDirectory() as folder:
            begun = cpu()
            run_ladder(LadderConfig(rung="nothing", n=n, profile="ideal", out=Path(folder)))
            costs.append(cpu() - begun - sum(line["cpu"] for line in read_costs(Path(folder))))
    return (costs[1] - costs[0]) / trials


def scheduled(workers: int, tasks: int) -> float:
    """Return tasks per second of a Dask scheduler with so many workers."""
    import distributed

    config = LadderConfig(rung="nothing", n=1, profile="ideal").whole()
    request, p = prepare(config)
    batch = Batch(request.target, (request.example,), 1.0, p.configs, p.code, p.versions)
    with (
        distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=False, dashboard_address="", memory_limit=0
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        client.wait_for_workers(workers)
        client.gather([client.submit(size, batch, pure=False) for _ in range(workers)])
        begun = time.perf_counter()
        for future in distributed.as_completed([client.submit(size, batch, pure=False) for _ in range(tasks)]):
            future.result()
        return tasks / (time.perf_counter() - begun)


def size(batch: Batch) -> int:
    """Do nothing with a batch; what a simulated worker is asked to do."""
    return len(batch.specs)


def main() -> None:
    """Print both figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--workers", type=int, default=64)
    parser.add_argument("--tasks", type=int, default=2000)
    options = parser.parse_args()
    RUNGS["nothing"] = "executor_overhead:Nothing"
    print(f"{1e3 * overhead(options.trials):.1f} ms CPU per trial beside the trial, n = {options.trials}")
    rate = scheduled(options.workers, options.tasks)
    print(f"{rate:.0f} tasks a second, {options.workers} simulated workers, n = {options.tasks}")


if __name__ == "__main__":
    main()
