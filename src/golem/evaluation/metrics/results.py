"""`golem results`: the tables of finished runs in Markdown, so that every published table comes from run folders."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

from golem.errors import ConfigError
from golem.evaluation.base import RUNGS, make_rung
from golem.evaluation.harness.records import TrialRecord, read_records
from golem.evaluation.harness.run_folder import finished_records, read_costs, read_facts, records_of_runs
from golem.evaluation.metrics.summary import summarise
from golem.evaluation.metrics.tables import run_tables
from golem.output_file import write_file

HOUR = 3600.0
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class GateHours:
    """What the gates of some trials did.

    Attributes:
        trials: trials in which it was counted.
        active: robot time in which commands passed [s].
        stops: stops by reason, without those that were asked for.
    """

    trials: int = 0
    active: float = 0.0
    stops: Counter[str] = field(default_factory=Counter[str])

    @classmethod
    def of(cls, costs: Iterable[Mapping[str, Any]]) -> GateHours:
        """Return the sum of lines of `timings.jsonl`; those without a count are left out."""
        counted = [line for line in costs if "active" in line]
        stops = Counter[str]()
        for line in counted:
            stops.update(line["stops"])
        return cls(len(counted), sum(float(line["active"]) for line in counted), stops)

    @property
    def most_per_hour(self) -> float:
        """Upper bound of the stops per robot hour, one-sided, 95 % (exact, of a Poisson process); inf without time."""
        if self.active <= 0.0:
            return float("inf")
        from scipy.stats import chi2

        return float(chi2.ppf(CONFIDENCE, 2 * (self.stops.total() + 1))) / 2.0 / (self.active / HOUR)

    def sentence(self) -> str:
        """Return it for a page."""
        n = self.stops.total()
        reasons = ", ".join(f"`{reason}` {k}" for reason, k in self.stops.most_common())
        return (
            f"Safety gate: {self.active / HOUR:.3g} robot hours open in {self.trials} trials, "
            f"{n} stop{'' if n == 1 else 's'}{f' ({reasons})' if reasons else ''}; "
            f"with 95 % confidence fewer than {self.most_per_hour:.3g} an hour."
        )


@dataclass(frozen=True)
class ResultsConfig:
    """Write what run folders hold: per folder its command, commit, n, seed, profile and tables; or for a paper."""

    runs: Positional[tuple[Path, ...]]
    """Run folders of golem ladder."""
    out: Path | None = None
    """The file to write. Default: the terminal."""
    format: Literal["markdown", "latex", "csv"] = "markdown"
    """markdown: tables. latex: tables for the package booktabs. csv: a row per trial, with all it measured."""
    figures: Path | None = None
    """Folder for the figures of the report as SVG, too."""


def run_results(config: ResultsConfig) -> str:
    """Return the tables, and write them.

    Raises:
        ConfigError: no folder is given, one holds no trials, or its trials are of several commits.
        OutputError: a file is no trial record, or the output cannot be written.
    """
    if not config.runs:
        raise ConfigError("Name at least one run folder.")
    if config.format == "csv":
        text = trials_csv(records_of_runs(config.runs))
    else:
        parts = [section(folder, config.format == "latex") for folder in config.runs]
        total = GateHours.of(line for folder in config.runs for line in gate_costs(folder))
        if len(parts) > 1 and total.trials:
            parts.append(f"{'% ' if config.format == 'latex' else ''}In all. {total.sentence()}")
        text = "\n\n".join(parts) + "\n"
    if config.out is None:
        print(text, end="")
    else:
        write_file(config.out, text)
    if config.figures is not None:
        from golem.evaluation.report.ladder_report import standalone_figures

        for folder in config.runs:
            for name, picture in standalone_figures(finished_records(folder)).items():
                write_file(config.figures / f"{folder.resolve().name}-{name}.svg", picture)
    return text


def trials_csv(records: Sequence[TrialRecord]) -> str:
    """Return a row per trial: what it is of, how it ended, and its scalars [SI units], empty where it has none."""
    cases, times, series = (
        dict.fromkeys(name for r in records for name in getattr(r, kind)) for kind in ("case", "timings", "series")
    )
    fixed = ("rung", "method", "profile", "seed", "index", "success", "stage", "module", "detail", "commit")
    stream = io.StringIO()
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow([*fixed, *cases, *(f"time_{name}" for name in times), *series])
    for r in records:
        own = [(r.case, cases), (r.timings, times), (r.series, series)]
        rows.writerow([*(getattr(r, name) for name in fixed), *(held.get(n, "") for held, names in own for n in names)])
    return stream.getvalue()


def section(folder: Path, latex: bool = False) -> str:
    """Return the Markdown of a run folder, or LaTeX with all but tables as comment. Raises as `run_results` does."""
    records = finished_records(folder)
    commits = list(dict.fromkeys(record.commit for record in records))
    if len(commits) > 1:
        raise ConfigError(f"{folder} holds trials of {len(commits)} commits, {', '.join(commits)}; measure again.")
    first = records[0]
    rung = make_rung(RUNGS[first.rung], first.options)
    methods = tuple(dict.fromkeys(record.method for record in records))
    summary = summarise(records, methods, read_costs(folder), compared=not rung.adaptive and _paired(records))
    own = rung.tables({m: [(r.spec, r.outcome) for r in records if r.method == m] for m in methods})
    tables = [*own, *([] if rung.adaptive else run_tables(summary))]
    fewest, most = min(row.n for row in summary.rows), max(row.n for row in summary.rows)
    count = f"{fewest}" if fewest == most else f"{fewest} to {most}"
    head = (
        f"Rung `{first.rung}`, profile `{first.profile}`, n = {count} per method{' and case' if first.case else ''}, "
        f"seed {first.seed}, commit `{commits[0]}`:"
    )
    command = read_facts(folder).get("command", "")
    hours = GateHours.of(gate_costs(folder))
    gates = hours.sentence() if hours.trials else ""
    if latex:
        parts = [*(f"% {line}" for line in (head, command, gates) if line), *(table.latex() for table in tables)]
    else:
        parts = [head, f"```sh\n{command}\n```" if command else "", *(table.markdown() for table in tables), gates]
    return "\n\n".join(part for part in parts if part)


def gate_costs(folder: Path) -> list[dict[str, Any]]:
    """Return a run's costs, none where stops are provoked. Raises OutputError: the folder has no trial records."""
    records = read_records(folder / "trials.jsonl")
    if not records or make_rung(RUNGS[records[0].rung], records[0].options).provokes:
        return []
    return read_costs(folder)


def _paired(records: Sequence[TrialRecord]) -> bool:
    keys = {m: {r.key[1:] for r in records if r.method == m} for m in {r.method for r in records}}
    return len({frozenset(k) for k in keys.values()}) == 1
