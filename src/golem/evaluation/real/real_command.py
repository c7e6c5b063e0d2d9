"""`golem real`: which real trials the twin predicts, and what both together say of the real success."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from tyro.conf import Positional, arg

from golem.errors import ConfigError
from golem.evaluation.base import case_name
from golem.evaluation.harness.records import TrialRecord, read_records
from golem.evaluation.metrics.metric_names import metric
from golem.evaluation.metrics.prediction_powered import prediction_powered
from golem.evaluation.metrics.statistics import Interval, wilson
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.real.real_trials import SUCCESS, RealRow, data_text, read_real
from golem.output_file import write_file

DRAWS = 4000
"""Samples of a bootstrap."""


@dataclass(frozen=True)
class RealConfig:
    """Put real trials beside the twin's of the same cells: which does it predict, and what is the real success?"""

    file: Annotated[Positional[str], arg(help_behavior_hint="(default: the paper's rows)")] = "paper"
    """A CSV of real trials; `paper` is the GOLEM paper's."""
    runs: tuple[Path, ...] = ()
    """Run folders of golem ladder with the twin's trials."""
    template: Path | None = None
    """Write a CSV to begin with to this file, and do nothing else."""


def run_real(config: RealConfig) -> int:
    """Print the tables; returns how many rows had trials of the twin.

    Raises:
        ConfigError: the CSV or a folder is none.
        golem.errors.OutputError: records cannot be read, or the template not be written.
    """
    if config.template is not None:
        print(f"Wrote {write_file(config.template, data_text('template'))}.")
        return 1
    rows = read_real(config.file)
    twins: list[TrialRecord] = []
    for run in config.runs:
        found = read_records(run / "trials.jsonl")
        if not found:
            raise ConfigError(f"{run} holds no trials; give --runs the folders of finished ladders.")
        twins += found
    profiles = sorted({record.profile for record in twins})
    if len(profiles) > 1:
        raise ConfigError(f"The runs are of the profiles {' and '.join(profiles)}; give those of one.")
    lines = [_compared(row, rows, _cell(row, twins)) for row in _pooled(rows)]
    columns = ("rung", "method", "case", "figure", "real", "twin", "predicted", "verdict", "real rate [%]", "with twin")
    title = f"Real trials and the twin's, profile {''.join(profiles) or '-'}"
    note = (
        "Predicted: what 95 % of such real samples would show if they were the twin's. Successes: beta-binomial after "
        "the twin's trials, Jeffreys' prior. Means: Student's t; with an sd, Welch's. Medians: bootstrap. "
        "With twin: prediction-powered (PPI++), and how many real trials it is worth; the twin helps where every real "
        "trial is a line of its own with the index of the twin's trial that it repeats."
    )
    print(TextTable(title, columns, tuple(lines), note).terminal())
    return sum(line[-1] != NO_TWIN for line in lines) or 1


NO_TWIN, SINGLE = "no trials of the twin", "single trials"


def _pooled(rows: Sequence[RealRow]) -> list[RealRow]:
    """Return rows with single trials of a cell counted together."""
    found = [row for row in rows if row.stat != "trial"]
    cells = dict.fromkeys((r.rung, r.method, r.case) for r in rows if r.stat == "trial")
    for cell in cells:
        mine = [r.value for r in rows if r.stat == "trial" and (r.rung, r.method, r.case) == cell]
        found.append(RealRow(*cell, SUCCESS, "count", len(mine), sum(mine), None, None, SINGLE))
    return found


def _cell(row: RealRow, twins: Sequence[TrialRecord]) -> list[TrialRecord]:
    """Return the twin's trials of the cell of a row."""
    same = [r for r in twins if (r.rung, r.method) == (row.rung, row.method)]
    return [r for r in same if row.case in ("", case_name(r.case))]


def predicted(row: RealRow, twin: Sequence[float]) -> Interval | None:
    """Return what 95 % of real samples as large as the row's would show, were they of the twin; None: unknown.

    Args:
        row: a count, mean or median.
        twin: its values in the twin's trials.
    """
    from scipy.stats import betabinom
    from scipy.stats import t as student

    x, n, size = np.asarray(twin, float), row.n, len(twin)
    if row.stat == "count":
        won = float(x.sum())
        low, high = betabinom.interval(0.95, n, won + 0.5, size - won + 0.5)
        return Interval(float(low), float(high))
    if size < 2:
        return None
    if row.stat == "median":
        drawn = np.median(np.random.default_rng(0).choice(x, (DRAWS, n)), axis=1)
        return Interval(*np.quantile(drawn, (0.025, 0.975)).tolist())
    mine, its = float(x.var(ddof=1)) / size, float(x.var(ddof=1) if row.sd is None else row.sd**2) / n
    free = size - 1.0
    if row.sd is not None and mine + its > 0.0:
        free = (mine + its) ** 2 / (mine**2 / (size - 1) + its**2 / (n - 1))
    half = float(student.ppf(0.975, free)) * float(np.sqrt(mine + its))
    return Interval(float(x.mean()) - half, float(x.mean()) + half)


def _compared(row: RealRow, rows: Sequence[RealRow], twin: Sequence[TrialRecord]) -> tuple[str, ...]:
    """Return the line of one row."""
    shown, count = metric(row.metric), row.stat == "count"
    values = [float(r.success) if count else r.series.get(row.metric, r.timings.get(row.metric)) for r in twin]
    known = [value for value in values if value is not None]
    words = SUCCESS if count else f"{row.stat}, {shown.label} [{shown.unit}]"
    real = f"{row.value:g} of {row.n}" if count else f"{shown.scale * row.value:.3g}, n = {row.n}"
    head = (row.rung, short_names([row.method])[row.method], row.case or "-", words, real)
    rate = wilson(row.value, row.n).text(100) if count else "-"
    span = predicted(row, known) if known else None
    if span is None:
        return (*head, "-", "-", NO_TWIN, rate, "-")
    middle = np.median(known) if row.stat == "median" else np.mean(known)
    its = f"{sum(known):g} of {len(known)}" if count else f"{shown.scale * middle:.3g}, n = {len(known)}"
    verdict = "below the twin" if row.value < span.low else "above the twin" if row.value > span.high else "predicted"
    return (*head, its, span.text(1.0 if count else shown.scale), verdict, rate, _powered(row, rows, twin))


def _powered(row: RealRow, rows: Sequence[RealRow], twin: Sequence[TrialRecord]) -> str:
    """Return the real success by real and simulated trials, where every real one repeats one of the twin's."""
    said = {r.index: float(r.success) for r in twin}
    single = [r for r in rows if r.stat == "trial" and (r.rung, r.method, r.case) == (row.rung, row.method, row.case)]
    if row.source != SINGLE or len(said) < len(twin) or any(r.index not in said for r in single):
        return "-"
    taken = [r.index for r in single if r.index is not None]
    others = [value for index, value in said.items() if index not in taken]
    found = prediction_powered([r.value for r in single], [said[index] for index in taken], others)
    return f"{found.interval.text(100)}, {found.worth:.0f}"
