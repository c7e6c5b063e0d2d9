"""From trial records to the figures that are quoted: always recomputed, never stored with the records."""

from __future__ import annotations

import itertools
import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from golem.evaluation.base import Case, case_name
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.metrics import statistics as stats
from golem.package_data import load_data


@dataclass(frozen=True, slots=True)
class Metric:
    """How one scalar is shown: `scale` is its unit per SI unit, `signed` whether it may be negative."""

    label: str
    unit: str = ""
    scale: float = 1.0
    signed: bool = False

    @property
    def share(self) -> bool:
        """Whether it is a share of what was asked, 0 to 1, in one trial."""
        return self.unit == "%"

    @property
    def bounds(self) -> tuple[float, float]:
        """Between what its values must lie, in SI units."""
        return (0.0, 1.0) if self.share else (-math.inf if self.signed else 0.0, math.inf)


SCALES = {"deg": math.degrees(1.0), "%": 100.0}
"""Unit in which a metric is shown -> that unit per SI unit, where `metrics.yaml` does not say."""


def _metrics() -> dict[str, Metric]:
    rows: dict[str, dict[str, Any]] = load_data(__package__, "metrics.yaml")
    for row in rows.values():
        row.setdefault("scale", SCALES.get(row.get("unit", ""), 1.0))
    return {name: Metric(**row) for name, row in rows.items()}


METRICS: dict[str, Metric] = _metrics()
"""Name -> how it is shown."""


def metric(name: str) -> Metric:
    """Return how the scalar `name` is shown; one that is not declared, as it is."""
    words = name.replace("_", " ")
    claim = Metric(words, "%", 100.0) if name.startswith("said_") else Metric(words, signed=True)
    return METRICS.get(name, claim)


NO_MODULE = "(no module to blame)"
"""Stands for the module of a failure that the rung attributes to none."""


@dataclass(frozen=True, slots=True)
class MethodSummary:
    """One method under one case of a rung.

    Attributes:
        case: the condition, empty on most rungs.
        n, successes: trials.
        interval: Wilson 95 % interval of the success rate.
        times: name -> robot time [s] over the trials that reached it.
        metrics: name -> scalar [SI units] over the trials that have it.
        costs: the same of what depends on the machine.
        stages: failing stage -> failures, most frequent first.
        modules: module -> failures, most frequent first.
    """

    method: str
    case: Case
    n: int
    successes: int
    interval: stats.Interval
    times: dict[str, stats.Distribution]
    metrics: dict[str, stats.Distribution]
    costs: dict[str, stats.Distribution]
    stages: dict[str, int]
    modules: dict[str, int]

    @property
    def rate(self) -> float:
        """Success rate, 0 to 1."""
        return self.successes / self.n


@dataclass(frozen=True, slots=True)
class PairedMean:
    """The mean difference of a metric, a minus b, over the `n` trials that have it with both methods."""

    n: int
    mean: float
    interval: stats.Interval | None


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two methods on the same trials.

    Attributes:
        table: paired counts.
        difference: 95 % interval of the success rate of `a` minus that of `b`.
        p: two-sided exact McNemar p-value.
        p_holm: the same, adjusted for the number of comparisons in the run.
        metrics: name -> paired difference, a minus b, where there is any.
    """

    a: str
    b: str
    case: Case
    table: stats.PairedTable
    difference: stats.Interval
    p: float
    p_holm: float
    metrics: dict[str, PairedMean]


@dataclass(frozen=True, slots=True)
class Pooled:
    """One method under all cases of a rung: trials of one index share a scene, which is the unit of the interval."""

    method: str
    n: int
    successes: int
    scenes: int
    interval: stats.Interval


@dataclass(frozen=True, slots=True)
class Summary:
    """All figures of one run, its rows case by case; `pooled` where there are several cases."""

    rows: tuple[MethodSummary, ...]
    comparisons: tuple[Comparison, ...]
    pooled: tuple[Pooled, ...] = ()

    def json(self) -> str:
        """Return the summary as one line of JSON; rates and intervals are 0 to 1, figures in SI units."""
        rows = [{**asdict(row), "rate": row.rate} for row in self.rows]
        others = {name: [asdict(one) for one in getattr(self, name)] for name in ("comparisons", "pooled")}
        return json.dumps({"rows": rows, **others})

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods, in the order they were asked for."""
        return tuple(dict.fromkeys(row.method for row in self.rows))

    @property
    def cases(self) -> tuple[Case, ...]:
        """The cases, in order."""
        return tuple({case_name(row.case): row.case for row in self.rows}.values())


def summarise(
    records: Sequence[TrialRecord],
    methods: Sequence[str],
    costs: Sequence[Mapping[str, Any]] = (),
    *,
    compared: bool = True,
) -> Summary:
    """Return the figures of `records`.

    Args:
        records: of the trials; methods are compared by those that both have.
        methods: their order.
        costs: lines of the run's `timings.jsonl`.
        compared: whether methods are compared pair by pair; not where an adaptive rung chose other cases for each.
    """
    cases = {case_name(r.case): r.case for r in records}
    grouped: dict[tuple[str, str], list[TrialRecord]] = {}
    for record in sorted(records, key=lambda r: r.index):
        grouped.setdefault((case_name(record.case), record.method), []).append(record)
    spent: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for line in costs:
        spent.setdefault((case_name(line["case"]), line["method"]), []).append(line)
    keys = [(name, method) for name in cases for method in methods if (name, method) in grouped]
    pairs = [
        pair
        for name in cases
        for a, b in itertools.combinations(methods, 2)
        if compared and all(pair := _common(grouped.get((name, a), ()), grouped.get((name, b), ())))
    ]
    rows = tuple(row(grouped[key], spent.get(key, [])) for key in keys)
    together = [pooled(method, records) for method in methods] if compared and len(cases) > 1 else []
    return Summary(rows, comparisons_of(pairs), tuple(one for one in together if one is not None))


def _common(a: Sequence[TrialRecord], b: Sequence[TrialRecord]) -> tuple[list[TrialRecord], list[TrialRecord]]:
    """Return those of the same indices, of which a run that ended early may have more with one method."""
    both = {r.index for r in a} & {r.index for r in b}
    one, other = ([r for r in side if r.index in both] for side in (a, b))
    return one, other


def by_scene(records: Sequence[TrialRecord]) -> dict[int, list[TrialRecord]]:
    """Return index -> its records, one per case: trials of one index share a scene."""
    found: dict[int, list[TrialRecord]] = {}
    for record in records:
        found.setdefault(record.index, []).append(record)
    return found


def pooled(method: str, records: Sequence[TrialRecord]) -> Pooled | None:
    """Return how often `method` succeeded under all cases together; None where it has no trial."""
    own = [record for record in records if record.method == method]
    if not own:
        return None
    scenes = [[record.success for record in scene] for scene in by_scene(own).values()]
    return Pooled(method, len(own), sum(map(sum, scenes)), len(scenes), stats.clustered(scenes))


def comparisons_of(pairs: Sequence[tuple[Sequence[TrialRecord], Sequence[TrialRecord]]]) -> tuple[Comparison, ...]:
    """Return the paired tests of records, each pair of the same case and the same indices in the same order."""
    tables = [stats.PairedTable.count([r.success for r in a], [r.success for r in b]) for a, b in pairs]
    ps = [stats.mcnemar(table) for table in tables]
    return tuple(
        Comparison(a[0].method, b[0].method, a[0].case, t, stats.paired_difference(t), p, adjusted, _paired(a, b))
        for (a, b), t, p, adjusted in zip(pairs, tables, ps, stats.holm(ps), strict=True)
    )


def row(records: Sequence[TrialRecord], costs: Sequence[Mapping[str, Any]] = ()) -> MethodSummary:
    """Return the figures of one method under one case; `costs` are its lines of `timings.jsonl`."""
    lost = [r for r in records if not r.success]
    successes = len(records) - len(lost)
    indices = {r.index for r in records}
    rest = ("method", "case", "index", "wall", "cpu", "active", "stops")
    timed = [{k: v for k, v in line.items() if k not in rest} for line in costs if line["index"] in indices]
    return MethodSummary(
        records[0].method,
        records[0].case,
        len(records),
        successes,
        stats.wilson(successes, len(records)),
        _distributions([r.timings for r in records]),
        _distributions([r.series for r in records]),
        _distributions(timed),
        dict(Counter(r.stage for r in lost).most_common()),
        dict(Counter(r.module or NO_MODULE for r in lost).most_common()),
    )


def _distributions(rows: Sequence[Mapping[str, float]]) -> dict[str, stats.Distribution]:
    names = sorted({name for row in rows for name in row})
    found = {name: stats.distribution([r[name] for r in rows if name in r], *metric(name).bounds) for name in names}
    return {name: d for name, d in found.items() if d is not None}


def _paired(a: Sequence[TrialRecord], b: Sequence[TrialRecord]) -> dict[str, PairedMean]:
    found: dict[str, PairedMean] = {}
    sides = [({**x.series, **x.timings}, {**y.series, **y.timings}) for x, y in zip(a, b, strict=True)]
    for name in sorted({name for one, _ in sides for name in one}):
        pairs = [(one[name], other[name]) for one, other in sides if name in one and name in other]
        differences = [first - second for first, second in pairs]
        if not any(differences):  # as the draws of a scene: both met the same
            continue
        share = metric(name).share
        if share and {value for pair in pairs for value in pair} <= {0.0, 1.0}:
            first, second = zip(*pairs, strict=True)
            interval = stats.paired_difference(stats.PairedTable.count(*([x == 1 for x in s] for s in (first, second))))
        else:
            interval = stats.mean_interval(differences, *((-1.0, 1.0) if share else ()))
        found[name] = PairedMean(len(pairs), sum(differences) / len(pairs), interval)
    return found
