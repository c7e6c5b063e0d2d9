"""The report of a run: one HTML file that needs no server, no script and no other file."""

from __future__ import annotations

import base64
import struct
from collections.abc import Mapping, Sequence
from html import escape
from importlib import resources
from pathlib import Path

from golem.evaluation.harness.records import TrialRecord, artefacts
from golem.evaluation.metrics.metric_labels import MEASURES, Measure
from golem.evaluation.metrics.published import PAPER
from golem.evaluation.metrics.statistics import spread, wilson
from golem.evaluation.metrics.summary import NO_MODULE, MethodSummary, Summary
from golem.evaluation.report.margin_plot import MOST, MarginCurve, margin_plot
from golem.evaluation.report.svg import Dot, interval_bar, percent_axis, stacked, strips, trial_map
from golem.robots.mujoco.balance import TRACE, BalanceTrace

HEADLINE_TIMES = {"detect_to_grasp": "detection<br>to grasp", "recovery": "recovery", "walk": "walk"}
"""The times that the success table may show, the first that the trials have, and what it calls them."""


def render(command: str, records: Sequence[TrialRecord], summary: Summary, folder: Path) -> str:
    """Return the report as HTML.

    Args:
        command: command line of the run.
        records: its trials, the same indices for each method, at least one.
        summary: their figures.
        folder: the run folder, in which the records' pictures lie.
    """
    grouped = {m.method: [r for r in records if r.method == m.method] for m in summary.methods}
    first = records[0]
    body = [
        _header(command, first, summary),
        _success(first.rung, summary),
        _comparisons(summary),
        _map(grouped),
        _failures(summary),
        _times(grouped),
        _measures(grouped),
        _margins(grouped, folder),
        _pictures(grouped, folder),
        _lost_trials(records),
        _reading(first.rung),
        _provenance(first, summary),
    ]
    css = resources.files("golem.evaluation.report").joinpath("report.css").read_text(encoding="utf-8")
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>GOLEM ladder: {escape(first.rung)}, {escape(first.profile)}</title>\n<style>\n{css}</style></head>\n"
        f"<body><main>\n{chr(10).join(part for part in body if part)}\n</main></body></html>\n"
    )


def _percent(value: float) -> str:
    return f"{100 * value:.1f}"


def _p(value: float) -> str:
    return "&lt; 0.0001" if value < 1e-4 else f"{value:.2g}"


def _card(title: str, content: str, note: str = "") -> str:
    words = f'<p class="note">{note}</p>' if note else ""
    return f'<h2>{title}</h2>{words}<section class="card">{content}</section>'


def _header(command: str, first: TrialRecord, summary: Summary) -> str:
    best = max(summary.methods, key=lambda m: m.rate)
    rates = "; ".join(
        f"<b>{escape(m.method)}</b> {_percent(m.rate)} % "
        f"[{_percent(m.interval.low)}, {_percent(m.interval.high)}]"
        for m in sorted(summary.methods, key=lambda m: -m.rate)
    )
    return (
        f'<header><p class="kicker">GOLEM capability ladder</p>'
        f"<h1>Rung <i>{escape(first.rung)}</i>, profile <i>{escape(first.profile)}</i></h1>"
        f'<p class="lead">{rates}. {best.n} simulated trials per method, the same scenes for each.</p>'
        f"<pre>{escape(command)}</pre></header>"
    )


def _success(rung: str, summary: Summary) -> str:
    rows = []
    time = next((name for name in HEADLINE_TIMES if any(name in m.times for m in summary.methods)), "")
    for i, m in enumerate(summary.methods):
        published = PAPER.get((rung, m.method), ())
        marks = [
            (p.successes / p.n, wilson(p.successes, p.n), f"paper, {p.label}: {p.successes} of {p.n}")
            for p in published
        ]
        notes = "".join(
            f"<small>paper, {escape(p.label)}: {p.successes}/{p.n}{', ' + escape(p.time) if p.time else ''}</small>"
            for p in published
        )
        rows.append(
            f'<tr><td><span class="swatch m{i % 6}"></span><b>{escape(m.method)}</b>{notes}</td>'
            f'<td class="rate num">{_percent(m.rate)} %<small>{m.successes} of {m.n}</small></td>'
            f'<td class="num">{_percent(m.interval.low)} to {_percent(m.interval.high)}</td>'
            f'<td class="plot">{interval_bar(m.rate, m.interval, i % 6, marks)}</td>'
            f'<td class="num">{_headline_time(m, time)}</td></tr>'
        )
    table = (
        '<div class="scroll"><table class="rates"><tr><th class="who">method</th><th class="num">success</th>'
        f'<th class="num">95 %<br>interval</th><th class="plot">{percent_axis()}</th>'
        f'<th class="num time">{HEADLINE_TIMES.get(time, "")}</th></tr>{"".join(rows)}</table></div>'
    )
    note = "Simulated success rates with Wilson 95 % intervals; median and quartiles of robot time."
    if any((rung, m.method) in PAPER for m in summary.methods):
        note += " Grey circles: figures that the GOLEM paper published, not measured here."
    return _card("Success", table, note)


def _headline_time(m: MethodSummary, name: str) -> str:
    time = m.times.get(name)
    if time is None:
        return "-"
    return f"{time.median:.1f} s<small>{time.q1:.1f} to {time.q3:.1f}{_of(time.n, m.n)}</small>"


def _of(n: int, trials: int) -> str:
    """Return how many trials a figure is of, where it is not of all."""
    return "" if n == trials else f", n = {n}"


def _comparisons(summary: Summary) -> str:
    if not summary.comparisons:
        return ""
    rows = "".join(
        f"<tr><td><b>{escape(c.a)}</b> against <b>{escape(c.b)}</b></td>"
        f'<td class="num">{c.table.both}</td><td class="num">{c.table.only_a}</td>'
        f'<td class="num">{c.table.only_b}</td><td class="num">{c.table.neither}</td>'
        f'<td class="num">{100 * (c.table.only_a - c.table.only_b) / c.table.n:+.1f}'
        f"<small>{100 * c.difference.low:+.1f} to {100 * c.difference.high:+.1f}</small></td>"
        f'<td class="num">{_p(c.p)}</td><td class="num">{_p(c.p_holm)}</td></tr>'
        for c in summary.comparisons
    )
    head = (
        '<tr><th>pair</th><th class="num">both<br>succeed</th><th class="num">only<br>first</th>'
        '<th class="num">only<br>second</th><th class="num">both<br>fail</th>'
        '<th class="num">difference<br>[points]</th><th class="num">McNemar<br>p</th>'
        '<th class="num">p, Holm-<br>adjusted</th></tr>'
    )
    return _card(
        "Paired comparison",
        f'<div class="scroll"><table>{head}{rows}</table></div>',
        "All methods met the same scenes, noise and screws; only the trials on which two methods disagree decide.",
    )


def _says(r: TrialRecord) -> str:
    if r.success:
        return f"trial {r.index}: success"
    blame = f", {r.module}" if r.module else ""
    return f"trial {r.index}: lost in {r.stage}{blame}{': ' + r.detail if r.detail else ''}"


def _map(grouped: Mapping[str, Sequence[TrialRecord]]) -> str:
    legend = (
        '<ul class="legend"><li><span class="swatch key-won"></span>success</li>'
        '<li><span class="swatch key-lost"></span>failure</li></ul>'
    )
    cells = {method: [(r.success, _says(r)) for r in rows] for method, rows in grouped.items()}
    return _card(
        "Trial by trial", trial_map(cells) + legend, "One column per trial; hover for what happened."
    )


def _failures(summary: Summary) -> str:
    if all(m.successes == m.n for m in summary.methods):
        return _card("Where it fails", "<p>No trial failed.</p>")
    parts = []
    for title, rows in (
        ("by stage", {m.method: m.stages for m in summary.methods}),
        ("by module", {m.method: m.modules for m in summary.methods}),
    ):
        totals: dict[str, int] = {}
        for causes in rows.values():
            for cause, count in causes.items():
                totals[cause] = totals.get(cause, 0) + count
        names = sorted(totals, key=lambda cause: (-totals[cause], cause))
        legend = "".join(
            f'<li><span class="swatch s{i % 8}"></span>{escape(name)} ({totals[name]})</li>'
            for i, name in enumerate(names)
        )
        plot = stacked(rows, {m.method: m.n for m in summary.methods}, names)
        parts.append(f'<h3>{title}</h3>{plot}<ul class="legend">{legend}</ul>')
    return _card(
        "Where it fails",
        "".join(parts),
        "The stage in which a trial was lost, and the module that lost it. A full bar would be all trials.",
    )


def _times(grouped: Mapping[str, Sequence[TrialRecord]]) -> str:
    names = dict.fromkeys(name for rows in grouped.values() for r in rows for name in r.timings)
    parts = []
    for name in names:
        dots = {
            method: [
                Dot(r.timings[name], r.success, f"{r.timings[name]:.2f} s, {_says(r)}")
                for r in rows
                if name in r.timings
            ]
            for method, rows in grouped.items()
        }
        parts.append(f"<h3>{escape(name.replace('_', ' '))}</h3>{strips(dots, 'seconds')}")
    if not parts:
        return ""
    return _card(
        "How long it takes",
        "".join(parts),
        "Robot time, not computing time. Box: median and quartiles; line: 10 to 90 %. Each dot is a trial that got "
        "that far, hollow where it failed later.",
    )


def _measures(grouped: Mapping[str, Sequence[TrialRecord]]) -> str:
    """Return a table of what the rung measured: median and quartiles per method."""
    measured = dict.fromkeys(name for rows in grouped.values() for r in rows for name in r.series)
    if not measured:
        return ""
    names = [*(name for name in MEASURES if name in measured), *sorted(measured.keys() - MEASURES.keys())]
    lines: list[str] = []
    for name in names:
        measure = MEASURES.get(name, Measure(name.replace("_", " ")))
        cells: list[str] = []
        for rows in grouped.values():
            s = spread([measure.scale * r.series[name] for r in rows if name in r.series])
            cells.append(
                '<td class="num">-</td>'
                if s is None
                else f'<td class="num">{s.median:.3g}'
                f"<small>{s.q1:.3g} to {s.q3:.3g}{_of(s.n, len(rows))}</small></td>"
            )
        lines.append(f"<tr><td>{escape(measure.label)}</td><td>{measure.unit}</td>{''.join(cells)}</tr>")
    head = "".join(f'<th class="num">{escape(method)}</th>' for method in grouped)
    return _card(
        "What was measured",
        f'<div class="scroll"><table><tr><th>measure</th><th>unit</th>{head}</tr>{"".join(lines)}</table></div>',
        "Median and quartiles over the trials that got that far, n where not all did; on the simulator's truth.",
    )


def _margins(grouped: Mapping[str, Sequence[TrialRecord]], folder: Path) -> str:
    """Return the CoM margin over time, per method, of the trials that kept a trace."""
    parts: list[str] = []
    for i, (method, rows) in enumerate(grouped.items()):
        kept = [(r, path) for r in rows if (path := artefacts(folder, r) / TRACE).is_file()]
        courses = [MarginCurve(BalanceTrace.load(path), r.success, _says(r)) for r, path in kept[:MOST]]
        plot = margin_plot(courses, i % 6) if courses else ""
        if plot:
            parts.append(f"<h3>{escape(method)}</h3>{plot}")
    if not parts:
        return ""
    return _card(
        "CoM margin",
        "".join(parts),
        "Signed distance of the projected centre of mass to the edge of the support polygon (the soles in contact), "
        f"positive inside; the force of the push above it. The first {MOST} trials of each method, trial 0 bold; a "
        "cross ends a lost one. A step makes the polygon one foot: the margin may dip below zero and come back.",
    )


def _pictures(grouped: Mapping[str, Sequence[TrialRecord]], folder: Path) -> str:
    figures = []
    for rows in grouped.values():
        for success in (False, True):
            chosen = next((r for r in rows if r.success is success and r.picture is not None), None)
            if chosen is None or chosen.picture is None or not (folder / chosen.picture).is_file():
                continue
            png = (folder / chosen.picture).read_bytes()
            # Width and height stand at a fixed place in a PNG; a strip of pictures takes the whole line.
            width, height = struct.unpack(">II", png[16:24])
            data = base64.b64encode(png).decode()
            says, cls = escape(_says(chosen)), ' class="strip"' if width > 2 * height else ""
            figures.append(
                f'<figure{cls}><img alt="{escape(chosen.method)}, {says}" '
                f'src="data:image/png;base64,{data}">'
                f"<figcaption><b>{escape(chosen.method)}</b>, {says}</figcaption></figure>"
            )
    if not figures:
        return ""
    return _card("What it looks like", f'<div class="pictures">{"".join(figures)}</div>')


def _lost_trials(records: Sequence[TrialRecord]) -> str:
    lost = [r for r in records if not r.success]
    if not lost:
        return ""
    rows = "".join(
        f'<tr><td class="num">{r.index}</td><td>{escape(r.method)}</td><td>{escape(r.stage)}</td>'
        f"<td>{escape(r.module or NO_MODULE)}</td><td>{escape(r.detail)}</td></tr>"
        for r in lost
    )
    head = '<tr><th class="num">trial</th><th>method</th><th>stage</th><th>module</th><th>what happened</th></tr>'
    return f"<details><summary>All {len(lost)} lost trials</summary><table>{head}{rows}</table></details>"


def _reading(rung: str) -> str:
    paper = (
        "<p>The paper's figures were obtained on the authors' robot and in their simulator. They "
        "stand beside ours for orientation; a simulated rate is no prediction of a rate on the robot.</p>"
        if any(key[0] == rung for key in PAPER)
        else ""
    )
    return (
        "<h2>How to read this</h2>"
        "<p>Trial <i>i</i> of every method has the same scene, noise stream and screw. A rate is quoted with its "
        "Wilson interval: over repeated draws of the seeds, 95 % of such intervals hold the true rate of this "
        "simulation.</p>"
        "<p>Two rates with overlapping intervals may still differ, because the trials are paired. McNemar's exact test "
        "asks only the trials that one method won and the other lost; at least six, all one way, are needed for "
        "p &lt; 0.05. The interval of the difference is Newcombe's for paired rates; Holm's adjustment allows for "
        "several pairs in one table. The tests hold for the n that was fixed in advance: looking, adding trials and "
        f"looking again is not covered by them.</p>{paper}"
    )


def _provenance(first: TrialRecord, summary: Summary) -> str:
    shown = {
        "trials": f"{summary.methods[0].n} per method, seed {first.seed}, index 0 to {summary.methods[0].n - 1}",
        "commit": first.commit,
        "code": first.code,
        "replaced modules": ", ".join(f"{slot}={use}" for slot, use in first.overrides.items()) or "none",
        "versions": ", ".join(f"{name} {version}" for name, version in first.versions.items()),
        "records": "trials.jsonl in this folder, one line per trial",
    }
    rows = "".join(f"<dt>{name}</dt><dd>{escape(value)}</dd>" for name, value in shown.items())
    return f"<h2>Provenance</h2><dl>{rows}</dl>"
