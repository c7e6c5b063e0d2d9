"""The standard tables of a run, for terminal, report and documents alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from golem.evaluation.base import Case
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.metrics.statistics import Distribution, Interval
from golem.evaluation.metrics.summary import METRICS, NO_MODULE, MethodSummary, Metric, PairedMean, Summary, metric
from golem.evaluation.metrics.text_table import TextTable, short_names

OF_A_MEAN = "of a share Wilson's or, where a trial is not a yes or no, by betting; else Student's t, cut at what can be"
"""How the interval of a mean was found."""
INTERVAL = "95 % interval"
BRIEF = (0, 1, 3, 4, 7, 8)
"""Columns of what was measured that a terminal shows."""
MINUS = "\N{MINUS SIGN}"


def run_tables(summary: Summary) -> list[TextTable]:
    """Return the tables that say all of a summary: rates, comparisons, metrics, and their paired differences."""
    tables = [rates(summary), all_cases(summary), comparisons(summary), metrics(summary), metric_differences(summary)]
    return [table for table in tables if table is not None]


def rates(summary: Summary) -> TextTable:
    """Return success rates with intervals, times, and where the rest was lost."""
    times = list(dict.fromkeys(name for row in summary.rows for name in row.times))
    columns = ["success", "rate", "95 % interval", *(f"{name.replace('_', ' ')} [s]" for name in times), "lost in"]
    short = short_names(summary.methods)
    rows = [
        (
            *_head(row, short),
            f"{row.successes}/{row.n}",
            f"{percent(row.rate)} %",
            _interval(row.interval, 100.0),
            *(_median(row.times.get(name)) for name in times),
            ", ".join(f"{stage} {count}" for stage, count in row.stages.items()) or "-",
        )
        for row in summary.rows
    ]
    note = "Wilson intervals" + ("; times: median and quartiles, robot time." if times else ".")
    return TextTable("", (*_names(summary), *columns), tuple(rows), note)


def all_cases(summary: Summary) -> TextTable | None:
    """Return success under all cases together; None where there is one case."""
    if not summary.pooled:
        return None
    short = short_names(summary.methods)
    rows = [
        (
            short[p.method],
            f"{p.successes}/{p.n}",
            f"{percent(p.successes / p.n)} %",
            _interval(p.interval, 100.0),
            f"{p.scenes}",
        )
        for p in summary.pooled
    ]
    note = "Trials of one index share a scene: Wilson interval with the design effect of these scenes."
    columns = ("method", "success", "rate", "95 % interval", "scenes")
    return TextTable("All cases together", columns, tuple(rows), note)


def losses(records: Sequence[TrialRecord]) -> TextTable | None:
    """Return where and by which module trials were lost, with one reason of each; None where none was."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for r in records:
        if not r.success:
            found.setdefault((r.method, r.stage, r.module or NO_MODULE), []).append(r.detail)
    short = short_names(record.method for record in records)
    rows = [
        (short[method], stage, module, str(len(reasons)), next(filter(None, reasons), "-"))
        for (method, stage, module), reasons in sorted(found.items(), key=lambda item: -len(item[1]))
    ]
    heads = ("method", "lost in", "by", "trials", "the first of them")
    return TextTable("Why trials were lost", heads, tuple(rows)) if rows else None


def comparisons(summary: Summary) -> TextTable | None:
    """Return the paired tests of success; None where nothing is compared."""
    if not summary.comparisons:
        return None
    columns = ("both", "only first", "only second", "neither", "difference [points]", "McNemar p", "Holm-adjusted p")
    short = short_names(summary.methods)
    rows = [
        (
            f"{short[c.a]} against {short[c.b]}",
            *_values(c.case),
            *(str(n) for n in (c.table.both, c.table.only_a, c.table.only_b, c.table.neither)),
            f"{100 * (c.table.only_a - c.table.only_b) / c.table.n:+.1f} {_interval(c.difference, 100.0, '+')}",
            p_value(c.p),
            p_value(c.p_holm),
        )
        for c in summary.comparisons
    ]
    least = max(2.0 * 0.5**c.table.n * len(summary.comparisons) for c in summary.comparisons)
    few = min(c.table.n for c in summary.comparisons)
    note = (
        f"With n = {few} no difference can be significant: p is {p_value(min(least, 1.0))} even where one method wins "
        "every trial and the other none."
        if least > 0.05
        else ""
    )
    return TextTable("Paired comparison of success", ("pair", *_names(summary)[1:], *columns), tuple(rows), note)


def metrics(summary: Summary, brief: bool = False) -> TextTable | None:
    """Return what was measured: median and mean with intervals, extremes; None where nothing was.

    `brief` leaves out what a terminal has no room for.
    """
    columns = ("n", "median", INTERVAL, "mean", INTERVAL, "rms", "95th percentile of size", "min", "max")
    shown = [i for i, name in enumerate(columns) if not brief or i in BRIEF]
    short = short_names(summary.methods)
    rows = [
        (_label(name), *_head(row, short), *(cells[i] for i in shown))
        for name in _measured([{**row.metrics, **row.costs} for row in summary.rows])
        for row in summary.rows
        if (d := {**row.metrics, **row.costs}.get(name)) is not None and (cells := _figures(d, metric(name)))
    ]
    if not rows:
        return None
    return TextTable(
        "What was measured",
        ("metric", *_names(summary), *(columns[i] for i in shown)),
        tuple(rows),
        "Over the trials that got that far. Intervals: "
        f"{'' if brief else 'median, between two values; '}mean, {OF_A_MEAN}.",
    )


def metric_differences(summary: Summary) -> TextTable | None:
    """Return the paired differences of what was measured; None where nothing is compared."""
    short = short_names(summary.methods)
    rows = [
        (
            _label(name),
            f"{short[c.a]} {MINUS} {short[c.b]}",
            *_values(c.case),
            str((d := c.metrics[name]).n),
            f"{(m := metric(name)).scale * d.mean:+.3g}",
            _interval(d.interval, m.scale, "+"),
        )
        for name in _measured([c.metrics for c in summary.comparisons])
        for c in summary.comparisons
        if name in c.metrics
    ]
    if not rows:
        return None
    columns = ("metric", "pair", *_names(summary)[1:], "n", "mean difference", "95 % interval")
    return TextTable("Paired differences", columns, tuple(rows), f"Over the pairs; {OF_A_MEAN}.")


def percent(value: float) -> str:
    """Return a rate, 0 to 1, in percent."""
    return f"{100 * value:.1f}"


def p_value(value: float) -> str:
    """Return a p-value as it is quoted."""
    return "< 0.0001" if value < 1e-4 else f"{value:.2g}"


def _names(summary: Summary) -> tuple[str, ...]:
    return ("method", *(summary.rows[0].case if summary.rows else ()))


def _head(row: MethodSummary, short: Mapping[str, str]) -> tuple[str, ...]:
    return (short[row.method], *_values(row.case))


def _values(case: Case) -> tuple[str, ...]:
    return tuple(value if isinstance(value, str) else f"{value:g}" for value in case.values())


def _measured(rows: Sequence[dict[str, Distribution]] | Sequence[dict[str, PairedMean]]) -> list[str]:
    """Return the names of what was measured, declared metrics first and in their order."""
    names = dict.fromkeys(name for row in rows for name in row)
    return [*(name for name in METRICS if name in names), *(name for name in names if name not in METRICS)]


def _label(name: str) -> str:
    m = metric(name)
    return f"{m.label} [{m.unit}]" if m.unit else m.label


def _figures(d: Distribution, m: Metric) -> tuple[str, ...]:
    return (
        str(d.n),
        number(d.median, m),
        _interval(d.median_interval, m.scale),
        number(d.mean, m),
        _interval(d.mean_interval, m.scale),
        *(number(x, m) for x in (d.rms, d.p95_size, d.minimum, d.maximum)),
    )


def number(value: float, m: Metric) -> str:
    """Return a value in the unit it is shown in, with three digits."""
    return f"{m.scale * value:.3g}"


def _median(d: Distribution | None) -> str:
    return "-" if d is None else f"{d.median:.3g} ({d.q1:.3g} to {d.q3:.3g}, n = {d.n})"


def _interval(interval: Interval | None, scale: float, sign: str = "") -> str:
    return "-" if interval is None else interval.text(scale, sign)
