"""From trial records to the figures that are quoted: always recomputed, never stored beside the records."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.metrics.statistics import (
    Interval,
    PairedTable,
    Spread,
    holm,
    mcnemar,
    paired_difference,
    spread,
    wilson,
)

NO_MODULE = "(no module to blame)"
"""Stands for the module of a failure that the rung attributes to none."""


@dataclass(frozen=True, slots=True)
class MethodSummary:
    """One method on one rung.

    Attributes:
        method: its name.
        n, successes: trials.
        interval: Wilson 95 % interval of the success rate.
        times: name -> spread [s, robot time] over the trials that reached it.
        stages: failing stage -> failures, most frequent first.
        modules: module -> failures, most frequent first.
    """

    method: str
    n: int
    successes: int
    interval: Interval
    times: dict[str, Spread]
    stages: dict[str, int]
    modules: dict[str, int]

    @property
    def rate(self) -> float:
        """Success rate, 0 to 1."""
        return self.successes / self.n


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two methods on the same trials.

    Attributes:
        a, b: the methods.
        table: paired counts.
        difference: 95 % interval of the success rate of `a` minus that of `b`.
        p: two-sided exact McNemar p-value.
        p_holm: the same, adjusted for the number of comparisons in the run.
    """

    a: str
    b: str
    table: PairedTable
    difference: Interval
    p: float
    p_holm: float


@dataclass(frozen=True, slots=True)
class Summary:
    """All figures of one run."""

    methods: tuple[MethodSummary, ...]
    comparisons: tuple[Comparison, ...]

    def json(self) -> str:
        """Return the summary as one line of JSON; rates and intervals are 0 to 1, times in robot seconds."""
        return json.dumps({
            "methods": {
                m.method: {
                    "n": m.n,
                    "successes": m.successes,
                    "rate": m.rate,
                    "interval": [m.interval.low, m.interval.high],
                    "median_times": {name: s.median for name, s in m.times.items()},
                    "failures_by_stage": m.stages,
                    "failures_by_module": m.modules,
                }
                for m in self.methods
            },
            "comparisons": [
                {
                    "a": c.a,
                    "b": c.b,
                    "only_a": c.table.only_a,
                    "only_b": c.table.only_b,
                    "difference": (c.table.only_a - c.table.only_b) / c.table.n,
                    "interval": [c.difference.low, c.difference.high],
                    "p": c.p,
                    "p_holm": c.p_holm,
                }
                for c in self.comparisons
            ],
        })  # fmt: skip

    def text(self) -> str:
        """Return a few lines for a terminal."""
        wide = max(len(m.method) for m in self.methods)
        lines = []
        for m in self.methods:
            low, high = 100 * m.interval.low, 100 * m.interval.high
            rate = f"{m.successes:4d}/{m.n:<4d} {100 * m.rate:5.1f} % [{low:.1f}, {high:.1f}]"
            lost = ", ".join(f"{stage} {count}" for stage, count in m.stages.items())
            times = ", ".join(f"{name} {s.median:.1f} s" for name, s in m.times.items())
            lines.append(f"{m.method:{wide}} {rate}  median: {times or '-'}  lost: {lost or '-'}")
        for c in self.comparisons:
            lines.append(
                f"{c.a} against {c.b}: {c.table.only_a} trials won only by the first, {c.table.only_b} only by the "
                f"second, exact McNemar p = {c.p:.2g}, Holm-adjusted {c.p_holm:.2g}"
            )
        return "\n".join(lines)


def summarise(records: Sequence[TrialRecord], methods: Sequence[str]) -> Summary:
    """Return the figures of `records`, which hold the same trial indices for each of `methods`."""
    grouped = {m: sorted((r for r in records if r.method == m), key=lambda r: r.index) for m in methods}
    pairs = list(itertools.combinations(methods, 2))
    tables = [PairedTable.count(*([r.success for r in grouped[m]] for m in pair)) for pair in pairs]
    ps = [mcnemar(table) for table in tables]
    return Summary(
        tuple(_method(m, grouped[m]) for m in methods),
        tuple(
            Comparison(a, b, table, paired_difference(table), p, adjusted)
            for (a, b), table, p, adjusted in zip(pairs, tables, ps, holm(ps), strict=True)
        ),
    )


def _method(method: str, records: Sequence[TrialRecord]) -> MethodSummary:
    lost = [r for r in records if not r.success]
    names = dict.fromkeys(name for r in records for name in r.timings)
    times = {name: spread([r.timings[name] for r in records if name in r.timings]) for name in names}
    successes = len(records) - len(lost)
    return MethodSummary(
        method,
        len(records),
        successes,
        wilson(successes, len(records)),
        {name: s for name, s in times.items() if s is not None},
        dict(Counter(r.stage for r in lost).most_common()),
        dict(Counter(r.module or NO_MODULE for r in lost).most_common()),
    )
