"""`golem real`: which real trials the twin predicts, and what both together say of the real success."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from tyro.conf import Positional, arg

from golem.errors import ConfigError, check_known, shorten, unknown_name
from golem.evaluation.base import RUNGS, case_name, make_rung
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.harness.run_folder import records_of_runs
from golem.evaluation.metrics.prediction_powered import prediction_powered
from golem.evaluation.metrics.published import GGX_F
from golem.evaluation.metrics.statistics import Interval, wilson
from golem.evaluation.metrics.summary import metric
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.finite import check_finite
from golem.options import fill, read_yaml
from golem.output_file import write_file

SHIPPED = files("golem.evaluation.real")
NUMBERS = ("n", "value", "sd", "index")
SUCCESS, NO_TWIN = "success", "no trials of the twin"
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


@dataclass(frozen=True, slots=True)
class RealRow:
    """One line of the CSV.

    Attributes:
        rung, method, case: the cell, as a ladder names it; an empty case is all cases.
        metric: `success`, or a figure of the ladder's records [SI units].
        stat: `count`: `value` of `n` trials were won; `trial`: one was (1) or was not (0); `mean` or `median` of `n`.
        value, n, sd: the figure, how many trials, and the standard deviation of a mean; None where nobody says.
        index: of the twin's trial that a `trial` repeats; None where it repeats none.
    """

    rung: str
    method: str
    metric: str
    stat: Literal["count", "trial", "mean", "median"]
    value: float
    n: int
    sd: float | None = None
    case: str = ""
    index: int | None = None
    source: str = ""

    @property
    def cell(self) -> tuple[str, str, str]:
        """Rung, method and case."""
        return self.rung, self.method, self.case

    def problem(self) -> str:
        """Return what cannot be; empty where all can."""
        success, counted = self.metric == SUCCESS, self.stat in ("count", "trial")
        if success != counted:
            valid = "count or trial" if success else "mean or median"
            return f"the stat of '{self.metric}' is {valid}, not '{self.stat}'"
        if not 1 <= self.n <= (1 if self.stat == "trial" else 10**6) or (self.index or 0) < 0:
            return "n is a number from 1 to a million, 1 of a trial, and an index none below 0"
        if success and not (float(self.value).is_integer() and 0 <= self.value <= self.n):
            return f"{self.value:g} of {self.n} successes cannot be; that is a whole number from 0 to {self.n}"
        if self.sd is not None and (self.stat != "mean" or self.n < 2 or self.sd <= 0.0):
            return "an sd is above 0, and of a mean of two trials or more"
        return "only a trial has an index" if self.index is not None and self.stat != "trial" else ""


def read_real(path: str) -> list[RealRow]:
    """Read a CSV; `paper` is the paper's rows. Raises ConfigError: unreadable, no column, or a wrong line; names it."""
    try:
        text = (SHIPPED / "paper.csv" if path == "paper" else Path(path)).read_text(encoding="utf-8-sig")
        table = csv.DictReader(io.StringIO(text, newline=""), None, "", "", strict=True, skipinitialspace=True)
        lines, columns = list(table), list(table.fieldnames or ())
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ConfigError(f"{path} cannot be read as CSV: {error}.") from error
    if not lines:
        raise ConfigError(f"{path} has no line of trials; golem real --template FILE writes one to begin with.")
    valid = {f.name for f in fields(RealRow)}
    if len(columns) != len(valid & {*columns}):
        said, names = shorten(", ".join(columns)), ", ".join(sorted(valid))
        raise ConfigError(f"The first line of {path} is '{said}'; it names {names}, each once, with commas between.")
    return [_row(f"line {k} of {path}", line) for k, line in enumerate(lines, start=2) if any(line.values())]


def _row(where: str, line: dict[str, str]) -> RealRow:
    if "" in line:
        raise ConfigError(f"In {where} are more cells than columns.")
    cells = {name: text.strip() for name, text in line.items() if text.strip()}
    values = {name: read_yaml(text, where) if name in NUMBERS else text for name, text in cells.items()}
    values = {"n": 1, **values} if cells.get("stat") == "trial" else values
    row: RealRow = fill(f"column in {where}", RealRow, values)
    check_finite(f"The value in {where}", np.array([row.value, row.sd or 0.0]))
    check_known(f"rung in {where}", RUNGS, row.rung)
    methods = _methods(row.rung)
    if row.method not in (*methods, "GGX-F") and ":" not in row.method and not row.method.startswith("{"):
        raise unknown_name(f"method in {where}", row.method, methods)
    if problem := row.problem():
        raise ConfigError(f"In {where}, {problem}.")
    return row


@cache
def _methods(rung: str) -> Sequence[str]:
    return make_rung(RUNGS[rung]).methods()


def run_real(config: RealConfig) -> int:
    """Print the table; returns how many rows there are.

    Raises:
        ConfigError: the CSV or a folder is none.
        golem.errors.OutputError: records cannot be read, or the template not be written.
    """
    if config.template is not None:
        if config.template.exists():
            raise ConfigError(f"{config.template} is there already; choose another name.")
        print(f"Wrote {write_file(config.template, (SHIPPED / 'template.csv').read_text('utf-8'))}.")
        return 1
    rows, twins = read_real(config.file), records_of_runs(config.runs)
    profiles = sorted({record.profile for record in twins})
    if len(profiles) > 1:
        raise ConfigError(f"The runs are of the profiles {' and '.join(profiles)}; give those of one.")
    singles: dict[tuple[str, str, str], list[RealRow]] = {row.cell: [] for row in rows}
    for row in rows:
        singles[row.cell] += [row] if row.stat == "trial" else []
    cells = [row for row in rows if row.stat != "trial"]
    for mine in filter(None, singles.values()):
        one, won = mine[0], sum(r.value for r in mine)
        cells.append(RealRow(one.rung, one.method, SUCCESS, "count", won, len(mine), case=one.case))
    lines = [compared(row, singles[row.cell], twins) for row in cells]
    columns = ("rung", "method", "case", "figure", "real", "twin", "predicted", "verdict", "real rate [%]", "with twin")
    note = (
        "Predicted: what 95 % of such real samples would show if they were the twin's. Successes: beta-binomial after "
        "the twin's trials, Jeffreys' prior. Means: Student's t. Medians: bootstrap. With twin: the real rate by both "
        "(PPI++), and how many real trials that is worth, where every real trial repeats one of the twin's."
    )
    title = f"Real trials and the twin's, profile {''.join(profiles) or '-'}"
    print(TextTable(title, columns, tuple(lines), note).terminal())
    return len(lines)


def predicted(row: RealRow, twin: Sequence[float]) -> Interval | None:
    """Return what 95 % of real samples as large as the row's would show, were they of the twin; None: unknown."""
    from scipy.stats import betabinom
    from scipy.stats import t as student

    x, n, size = np.asarray(twin, float), row.n, len(twin)
    if row.stat == "count":
        low, high = betabinom.interval(0.95, n, x.sum() + 0.5, size - x.sum() + 0.5)
        return Interval(float(low), float(high))
    if size < 2:
        return None
    if row.stat == "median":
        drawn = np.median(np.random.default_rng(0).choice(x, (DRAWS, n)), axis=1)
        return Interval(*np.quantile(drawn, (0.025, 0.975)).tolist())
    # With an sd of the real trials, the lesser degrees of freedom: no less than Welch's.
    real, free = (x.var(ddof=1), size - 1) if row.sd is None else (row.sd**2, min(size, n) - 1)
    half = student.ppf(0.975, free) * np.sqrt(x.var(ddof=1) / size + real / n)
    return Interval(float(x.mean() - half), float(x.mean() + half))


def compared(row: RealRow, singles: Sequence[RealRow], twins: Sequence[TrialRecord]) -> tuple[str, ...]:
    """Return the line of one row, whose single trials are `singles`."""
    method = GGX_F if row.method == "GGX-F" else row.method
    twin = [r for r in twins if (r.rung, r.method) == (row.rung, method) and row.case in ("", case_name(r.case))]
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
    both, said = "-", {r.index: float(r.success) for r in twin}
    if count and row.n == len(singles) and len(said) == len(twin) and all(r.index in said for r in singles):
        taken = [r.index for r in singles if r.index is not None]
        others = [value for index, value in said.items() if index not in taken]
        powered = prediction_powered([r.value for r in singles], [said[index] for index in taken], others)
        both = f"{powered.interval.text(100)}, {powered.worth:.0f}"
    return (*head, its, span.text(1.0 if count else shown.scale), verdict, rate, both)
