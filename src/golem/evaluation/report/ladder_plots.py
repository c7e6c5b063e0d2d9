"""The figures of a ladder's report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from golem.evaluation.base import RUNGS, case_name, make_rung
from golem.evaluation.harness.records import TrialRecord
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.statistics import Interval, wilson
from golem.evaluation.metrics.summary import MethodSummary, Summary, summarise
from golem.evaluation.metrics.text_table import short_names
from golem.evaluation.report.svg_figure import COLOUR, cause_colour, method_colour, page_figure, standalone, styled, svg

ROW = 34.0
"""Height of one row of a figure [px]."""
FRAME = 70.0
"""Height of what is around the rows [px]."""


def label(row: MethodSummary, short: Mapping[str, str]) -> str:
    """Return what a row of figures is called."""
    return ", ".join(part for part in (short[row.method], case_name(row.case)) if part)


def rate_plot(rung: str, summary: Summary) -> str:
    """Return success rates with their intervals, and what the paper published below each."""
    short, lines = short_names(summary.methods), list[tuple[str, float, Interval, str, bool]]()
    for row in summary.rows:
        colour = method_colour(summary.methods.index(row.method))
        lines.append((label(row, short), row.rate, row.interval, colour, True))
        for p in PAPER.get((rung, row.method), ()):
            interval = wilson(p.successes, p.n)
            lines.append(
                (f"paper, {p.label}: {p.successes}/{p.n}", p.successes / p.n, interval, COLOUR["muted"], False)
            )
    figure = page_figure(FRAME + 0.8 * ROW * len(lines))
    axes = figure.subplots()
    for y, (_, rate, interval, colour, ours) in enumerate(lines):
        bounds = [100 * interval.low, 100 * interval.high]
        axes.plot(bounds, [y, y], color=colour, lw=9 if ours else 2, alpha=0.35 if ours else 1)
        face = colour if ours else "none"
        axes.plot(100 * rate, y, "o", ms=9 if ours else 6, mfc=face, mec=colour, clip_on=False, zorder=3)
    axes.set(xlim=(0, 100), ylim=(len(lines) - 0.4, -0.6), xlabel="success rate, Wilson 95 % interval [%]")
    axes.set_yticks(range(len(lines)), [name for name, *_ in lines])
    for tick, (*_, ours) in zip(axes.get_yticklabels(), lines, strict=True):
        tick.set(color=COLOUR["ink" if ours else "muted"], fontsize=11 if ours else 9)
    axes.grid(axis="y", visible=False)
    return svg(figure, "success rates with intervals")


def failure_plot(summary: Summary, kind: str) -> str:
    """Return failures by cause; `kind` is `stages` or `modules`. A full bar would be all trials."""
    causes: list[dict[str, int]] = [getattr(row, kind) for row in summary.rows]
    totals: dict[str, int] = {}
    for row in causes:
        for cause, count in row.items():
            totals[cause] = totals.get(cause, 0) + count
    names = sorted(totals, key=lambda cause: (-totals[cause], cause))
    figure = page_figure(FRAME + ROW * len(causes) + 18.0 * ((len(names) + 2) // 3))
    axes = figure.subplots()
    y = np.arange(len(causes))
    axes.barh(y, [row.n for row in summary.rows], color=COLOUR["track"], height=0.62)
    left = np.zeros(len(causes))
    for i, name in enumerate(names):
        counts = np.array([row.get(name, 0) for row in causes])
        bars = axes.barh(y, counts, left=left, color=cause_colour(i), height=0.62, label=f"{name} ({totals[name]})")
        axes.bar_label(bars, [str(n) if n else "" for n in counts], label_type="center", color="white", fontsize=9)
        left += counts
    axes.set(ylim=(len(causes) - 0.4, -0.6), xlabel="trials")
    short = short_names(summary.methods)
    axes.set_yticks(y, [label(row, short) for row in summary.rows])
    axes.locator_params(axis="x", integer=True)
    axes.grid(axis="y", visible=False)
    figure.legend(loc="outside lower center", ncols=3, labelcolor=COLOUR["ink"], fontsize=9)
    return svg(figure, f"failures by {kind}")


def time_plot(name: str, grouped: Mapping[str, Sequence[TrialRecord]]) -> str:
    """Return the time called `name` of every trial that reached it, with median and quartiles."""
    figure = page_figure(FRAME + 1.4 * ROW * len(grouped))
    axes = figure.subplots()
    for y, rows in enumerate(grouped.values()):
        colour, reached = method_colour(y), [r for r in rows if name in r.timings]
        values = np.array([r.timings[name] for r in reached])
        if not len(values):
            where = axes.get_yaxis_transform()
            axes.text(0.01, y, "no trial reached it", color=COLOUR["muted"], va="center", transform=where)
            continue
        box = axes.boxplot(
            values, positions=[y - 0.15], orientation="horizontal", widths=0.26, whis=(10, 90), showfliers=False,
            patch_artist=True, manage_ticks=False,
        )  # fmt: skip
        for part, lines in box.items():
            for line in lines:
                line.set(color=colour, lw=2 if part == "medians" else 1)
        for patch in box["boxes"]:
            patch.set(facecolor=colour, alpha=0.3, edgecolor=colour)
        # The golden ratio spreads neighbours over the lane, the same way each time.
        lane = y + 0.1 + 0.3 * ((np.arange(len(values)) * 0.618034) % 1)
        won = np.array([r.success for r in reached])
        for chosen, face in ((won, colour), (~won, "none")):
            dots = axes.scatter(values[chosen], lane[chosen], s=16, linewidths=0.8, alpha=0.8)
            dots.set(facecolors=face, edgecolors=colour)
    axes.set(ylim=(len(grouped) - 0.4, -0.6), xlabel="robot time [s]")
    axes.set_xlim(left=0)
    axes.set_yticks(range(len(grouped)), list(short_names(grouped).values()))
    axes.grid(axis="y", visible=False)
    return svg(figure, f"{name} in seconds")


def standalone_figures(records: Sequence[TrialRecord]) -> dict[str, str]:
    """Return the figures of a run by name, each as the text of an SVG file.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    methods = tuple(dict.fromkeys(record.method for record in records))
    rung = make_rung(RUNGS[records[0].rung], records[0].options)
    grouped = {method: [r for r in records if r.method == method] for method in methods}
    summary = summarise(records, methods, compared=False)
    with styled():
        own = own_plot(rung, {m: [(r.spec, r.outcome) for r in rows] for m, rows in grouped.items()})
        found = {} if own is None else {"own": own[1]}
        if not rung.adaptive:
            found["success"] = rate_plot(rung.name, summary)
            if any(not record.success for record in records):
                found |= {kind: failure_plot(summary, kind) for kind in ("stages", "modules")}
        times = dict.fromkeys(name for record in records for name in record.timings)
        found |= {name: time_plot(name, grouped) for name in times}
    return {name: standalone(picture) for name, picture in found.items()}


def own_plot(rung: Any, outcomes: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return title and figure that a rung draws of itself; None where it draws none."""
    figure = page_figure(420.0)
    title = rung.plot(outcomes, figure)
    return None if title is None else (title, svg(figure, title))
