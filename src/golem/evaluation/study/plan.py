"""What a study will cost and can find, before it is run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from golem.evaluation.harness.ladder import prepare, run_ladder
from golem.evaluation.harness.run_folder import read_costs
from golem.evaluation.metrics.anytime import ALPHA, anytime_p, equal_within, paired_evidence
from golem.evaluation.metrics.statistics import PairedTable, mcnemar, wilson
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.study.study_file import Cell, StudyFile
from golem.types import Array

STUDIES = 1000
"""Simulated comparisons, seed 0."""
POWER = 0.8
LIKELY = 0.8
"""Success of the better method where nothing is known; a scene counts half for both (correlation of the draws)."""
STEPS = np.arange(0.05, 0.85, 0.05)
"""Differences of success that are tried."""
HOUR = 3600.0


def plan_table(study: StudyFile, cells: Sequence[Cell], comparisons: int) -> TextTable:
    """Return a row per cell: trials, hours on this machine, and the difference it finds with 80 % power.

    CPU seconds per trial are those of the records in the cell's folder; where it has none, trial 0 of each method is
    run there and kept.
    """
    rows, hours, trials = list[tuple[str, ...]](), 0.0, 0
    for cell in cells:
        n, m = cell.config.n or 0, len(cell.config.method)
        request = prepare(cell.config)[0]
        each = 1 if request.rung.adaptive else len(request.rung.cases(lambda case: None))
        count, cpu = n * m * each + max(0, (cell.best_n or n) - n) * min(m, 2) * each, _seconds(cell)
        cost = count * cpu / HOUR / max(cell.config.j, 1)
        hours, trials = hours + cost, trials + count
        finds = smallest_difference(n, comparisons) if m > 1 else wilson(LIKELY * n, n).high - wilson(LIKELY * n, n).low
        median = _median_end(study, n, comparisons, finds) if study.stop == "decided" and m > 1 else None
        rows.append(
            (
                cell.name, str(m), str(n), str(count), f"{cpu:.1f}", f"{cost:.2f}",
                "-" if median is None else str(median),
                f"{'width ' if m == 1 else ''}{100 * finds:.0f}" if finds < 1.0 else "none",
            )
        )  # fmt: skip
    rows.append(("all", "", "", str(trials), "", f"{hours:.2f}", "-", "-"))
    return TextTable(
        f"Plan of {study.title}",
        ("cell", "methods", "n", "trials at most", "CPU s a trial", "hours at most", "decided after", "finds"),
        tuple(rows),
        f"Hours with -j {cells[0].config.j} here. Finds [points], with {100 * POWER:.0f} % power by McNemar over "
        f"{comparisons} comparisons, the better at {100 * LIKELY:.0f} % or more; of one method: width of its interval. "
        f"Decided after: median of pairs at that difference with `stop: decided`. {STUDIES} simulated studies.",
    )


def smallest_difference(n: int, comparisons: int) -> float:
    """Return the least of `STEPS` that n pairs find with `POWER`; 1 where none is."""
    for step in STEPS:
        a, b = simulated(float(step), n)
        ps = {}
        won, lost = (a > b).sum(axis=1), (b > a).sum(axis=1)
        for pair in zip(won.tolist(), lost.tolist(), strict=True):
            ps.setdefault(pair, mcnemar(PairedTable(0, *pair, 0)))
        power = np.mean([ps[pair] <= ALPHA / comparisons for pair in zip(won.tolist(), lost.tolist(), strict=True)])
        if power >= POWER:
            return float(step)
    return 1.0


def simulated(difference: float, n: int, seed: int = 0) -> tuple[Array, Array]:
    """Return successes, each (STUDIES, n), of two methods so far apart that share half of what makes a scene hard."""
    rng = np.random.default_rng(seed)
    better = max(LIKELY, difference + 0.05)
    scene = rng.random((STUDIES, n))
    own = np.where(rng.random((STUDIES, n)) < 0.5, scene, rng.random((STUDIES, n)))
    return (scene < better).astype(float), (own < better - difference).astype(float)


def _median_end(study: StudyFile, n: int, comparisons: int, difference: float) -> int:
    """Return after how many pairs a comparison ends, at the median."""
    a, b = simulated(min(difference, 0.9), n)
    alpha = ALPHA / comparisons
    done = (anytime_p(paired_evidence(a, b)) <= alpha) | equal_within(a, b, study.margin, alpha)
    return int(np.median(np.where(done.any(axis=1), done.argmax(axis=1) + 1, n)))


def _seconds(cell: Cell) -> float:
    """Return CPU time per trial of a cell on this machine [s]."""
    assert cell.config.out is not None
    costs = read_costs(cell.config.out)
    if not costs:
        run_ladder(replace(cell.config, n=1, stop="never"))
        costs = read_costs(cell.config.out)
    return math.fsum(float(line["cpu"]) for line in costs) / len(costs)
