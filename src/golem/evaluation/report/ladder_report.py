"""The report of a run: one HTML file that needs no server, no script and no other file."""

from __future__ import annotations

import base64
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from golem.evaluation.base import RUNGS, case_name, make_rung
from golem.evaluation.episodes.last_seconds import FILM
from golem.evaluation.harness.records import TrialRecord, artefacts, trial_name
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.statistics import Interval, wilson
from golem.evaluation.metrics.summary import NO_MODULE, MethodSummary, Summary, summarise
from golem.evaluation.metrics.tables import all_cases, comparisons, metric_differences, metrics, rates
from golem.evaluation.metrics.text_table import short_names
from golem.evaluation.report import margin_plot as margins
from golem.evaluation.report import svg_figure
from golem.evaluation.report.svg_figure import COLOUR, cause_colour, method_colour, page_figure, styled, svg
from golem.robots.mujoco.balance import BalanceTrace

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
    """Return the figures of a run by name, as texts of SVG files. Raises MissingExtra: without matplotlib."""
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
    return {name: svg_figure.standalone(picture) for name, picture in found.items()}


def own_plot(rung: Any, outcomes: Mapping[str, Any]) -> tuple[str, str] | None:
    """Return title and figure that a rung draws of itself; None where it draws none."""
    figure = page_figure(420.0)
    title = rung.plot(outcomes, figure)
    return None if title is None else (title, svg(figure, title))


MAX_FILMS = 24
"""Films that the page itself holds at most; the others lie beside it."""

if TYPE_CHECKING:
    from golem.evaluation.harness.ladder import LadderResult


def render(result: LadderResult) -> str:
    """Return the report of a finished ladder as HTML. Raises MissingExtra: what draws it is not installed."""
    config, summary, records = result.config, result.summary, result.records
    first, rung = records[0], make_rung(RUNGS[config.rung], records[0].options)
    grouped = {method: [r for r in records if r.method == method] for method in summary.methods}
    lost = [r for r in records if not r.success]
    failed = bool(lost) and not rung.adaptive
    times = dict.fromkeys(name for r in records for name in r.timings)
    with styled():
        plots, boxes = _margins(grouped, result.out)
        return svg_figure.render_page(
            "ladder.html",
            _provenance(result),
            rung=first.rung,
            profile=first.profile,
            purpose=(type(rung).__doc__ or "").strip().partition("\n")[0],
            command=config.command(),
            own_tables=result.own,
            own_plot=own_plot(rung, {m: [(r.spec, r.outcome) for r in rows] for m, rows in grouped.items()}),
            rates=rates(summary),
            rate_plot="" if rung.adaptive else rate_plot(first.rung, summary),
            all_rates=[rates(summary)] if rung.adaptive else [],
            comparisons=[table for table in (all_cases(summary), comparisons(summary)) if table],
            paper=any((first.rung, method) in PAPER for method in summary.methods),
            map={} if rung.adaptive else _map(records, summary),
            failure_plots=[(f"by {k[:-1]}", failure_plot(summary, k)) for k in ("stages", "modules") if failed],
            adaptive=rung.adaptive,
            time_plots=[(name.replace("_", " "), time_plot(name, grouped)) for name in times],
            metrics=[] if rung.adaptive else [t for t in (metrics(summary), metric_differences(summary)) if t],
            margin_boxes=boxes,
            margin_plots=plots,
            max_curves=margins.MAX_CURVES,
            pictures=_pictures(grouped, result.out),
            films=_films(lost, result.out),
            lost=[_row(r, result.out) for r in lost],
            traces=any(r.trace for r in lost),
            show=f"{config.command()} --show {trial_name(lost[0])}" if lost else "",
        )


def _says(r: TrialRecord) -> str:
    if r.success:
        return f"trial {r.index}: success"
    blame = f", {r.module}" if r.module else ""
    return f"trial {r.index}: lost in {r.stage}{blame}{': ' + r.detail if r.detail else ''}"


def _row(r: TrialRecord, folder: Path) -> dict[str, str | None]:
    module = r.module or NO_MODULE
    path = artefacts(folder, r) / FILM
    film = path.relative_to(folder).as_posix() if path.is_file() else None
    row = {"name": trial_name(r), "stage": r.stage, "module": module, "detail": r.detail}
    return {**row, "trace": r.trace, "film": film}


def _films(lost: Sequence[TrialRecord], folder: Path) -> list[dict[str, str]]:
    """Return the films of lost trials, at first one of each method and stage, `MAX_FILMS` at most."""
    filmed = [(r, path) for r in lost if (path := artefacts(folder, r) / FILM).is_file()]
    seen = Counter[tuple[str, str]]()
    turns: list[int] = []
    for r, _ in filmed:
        turns.append(seen[r.method, r.stage])
        seen[r.method, r.stage] += 1
    chosen = sorted(range(len(filmed)), key=lambda k: turns[k])[:MAX_FILMS]
    return [
        {"method": r.method, "says": _says(r), "data": base64.b64encode(path.read_bytes()).decode()}
        for r, path in (filmed[k] for k in sorted(chosen))
    ]


def _map(records: Sequence[TrialRecord], summary: Summary) -> dict[str, list[tuple[bool, str]]]:
    """Return, per method and case, whether each trial succeeded and what a hover says."""
    found, short = dict[str, list[tuple[bool, str]]](), short_names(summary.methods)
    for case in summary.cases:
        for method in summary.methods:
            cells = [(r.success, _says(r)) for r in records if (r.method, r.case) == (method, case)]
            found[" ".join(part for part in (short[method], case_name(case)) if part)] = cells
    return found


def _margins(grouped: Mapping[str, Sequence[TrialRecord]], folder: Path) -> tuple[list[tuple[str, str]], str]:
    """Return the CoM margin over time, per method, of the trials that kept a trace, and boxes of its means."""
    plots, traces, short = list[tuple[str, str]](), dict[str, list[BalanceTrace]](), short_names(grouped)
    for i, (method, rows) in enumerate(grouped.items()):
        kept = margins.kept_traces(rows, folder)
        plot = margins.margin_plot([(trace, r.success) for r, trace in kept], i)
        if plot:
            plots.append((short[method], plot))
        traces[short[method]] = [trace for _, trace in kept]
    return plots, margins.margin_boxes(traces)


def _pictures(grouped: Mapping[str, Sequence[TrialRecord]], folder: Path) -> list[dict[str, Any]]:
    """Return a failure and a success of each method that has a picture."""
    found: list[dict[str, Any]] = []
    for rows in grouped.values():
        for success in (False, True):
            chosen = next((r for r in rows if r.success is success and r.picture is not None), None)
            if chosen is None or chosen.picture is None or not (folder / chosen.picture).is_file():
                continue
            png = (folder / chosen.picture).read_bytes()
            # Width and height stand at a fixed place in a PNG; a strip of pictures takes the whole line.
            width, height = struct.unpack(">II", png[16:24])
            data = base64.b64encode(png).decode()
            found.append({"method": chosen.method, "says": _says(chosen), "data": data, "wide": width > 2 * height})
    return found


def _provenance(result: LadderResult) -> dict[str, str]:
    first, n = result.records[0], max(row.n for row in result.summary.rows)
    return {
        "trials": f"{n} per method{' and case' if first.case else ''}, seed {first.seed}, index 0 to {n - 1}",
        "commit": ", ".join(dict.fromkeys(r.commit for r in result.records)),
        "code": first.code,
        "replaced modules": ", ".join(f"{slot}={use}" for slot, use in first.overrides.items()) or "none",
        "options of the rung": ", ".join(f"{k}={v}" for k, v in first.options.items()) or "none",
        "versions": ", ".join(f"{name} {version}" for name, version in first.versions.items()),
        "records": "trials.jsonl in this folder, one line per trial; run.json: every option of every module",
    }
