"""The report of a run: one HTML file that needs no server, no script and no other file."""

from __future__ import annotations

import base64
import struct
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from golem.evaluation.base import RUNGS, case_name, make_rung
from golem.evaluation.episodes.last_seconds import FILM
from golem.evaluation.harness.records import TrialRecord, artefacts, trial_name
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.summary import NO_MODULE, Summary
from golem.evaluation.metrics.tables import all_cases, comparisons, metric_differences, metrics, rates
from golem.evaluation.metrics.text_table import short_names
from golem.evaluation.report.html_page import render_page
from golem.evaluation.report.ladder_plots import failure_plot, own_plot, rate_plot, time_plot
from golem.evaluation.report.margin_plot import (
    MAX_CURVES,
    MarginBox,
    MarginCurve,
    kept_traces,
    margin_box,
    margin_boxes,
    margin_plot,
)
from golem.evaluation.report.svg_figure import styled

MAX_FILMS = 24
"""Films that the page itself holds at most; the others lie beside it."""

if TYPE_CHECKING:
    from golem.evaluation.harness.ladder import LadderResult


def render(result: LadderResult) -> str:
    """Return the report of a finished ladder as HTML.

    Raises:
        golem.errors.MissingExtra: what draws it is not installed.
    """
    config, summary, records = result.config, result.summary, result.records
    first, rung = records[0], make_rung(RUNGS[config.rung], records[0].options)
    grouped = {method: [r for r in records if r.method == method] for method in summary.methods}
    lost = [r for r in records if not r.success]
    failed = bool(lost) and not rung.adaptive
    times = dict.fromkeys(name for r in records for name in r.timings)
    with styled():
        plots, boxes = _margins(grouped, result.out)
        return render_page(
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
            failure_plots=_failures(summary) if failed else [],
            adaptive=rung.adaptive,
            time_plots=[(name.replace("_", " "), time_plot(name, grouped)) for name in times],
            metrics=[] if rung.adaptive else [t for t in (metrics(summary), metric_differences(summary)) if t],
            margin_boxes=boxes,
            margin_plots=plots,
            max_curves=MAX_CURVES,
            pictures=_pictures(grouped, result.out),
            films=_films(lost, result.out),
            lost=[_row(r, result.out) for r in lost],
            traces=any(r.trace for r in lost),
            show=f"{config.command()} --show {trial_name(lost[0])}" if lost else "",
        )


def _failures(summary: Summary) -> list[tuple[str, str]]:
    return [("by stage", failure_plot(summary, "stages")), ("by module", failure_plot(summary, "modules"))]


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
        {
            "method": filmed[k][0].method,
            "says": _says(filmed[k][0]),
            "data": base64.b64encode(filmed[k][1].read_bytes()).decode(),
        }
        for k in sorted(chosen)
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
    plots, boxes, short = list[tuple[str, str]](), list[MarginBox](), short_names(grouped)
    for i, (method, rows) in enumerate(grouped.items()):
        kept = kept_traces(rows, folder)
        plot = margin_plot([MarginCurve(trace, r.success) for r, trace in kept[:MAX_CURVES]], i)
        if plot:
            plots.append((short[method], plot))
        box = margin_box(short[method], [trace for _, trace in kept], i)
        if box is not None:
            boxes.append(box)
    return plots, margin_boxes(boxes)


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
