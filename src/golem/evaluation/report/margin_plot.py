"""CoM margin over time, the force of the push above it: the figures of the paper's section on pushes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from golem.evaluation.harness.records import TrialRecord, artefacts
from golem.evaluation.report.svg_figure import COLOUR, method_colour, page_figure, svg
from golem.robots.mujoco.balance import TRACE, BalanceTrace

ROW = 30.0
"""Height of a box with its name [px]."""
FRAME = 70.0
"""Height of what is around the boxes [px]."""


def kept_traces(records: Sequence[TrialRecord], folder: Path) -> list[tuple[TrialRecord, BalanceTrace]]:
    """Return the trials in the run `folder` that kept a trace, with it."""
    paths = [(r, artefacts(folder, r) / TRACE) for r in records]
    return [(r, BalanceTrace.load(path)) for r, path in paths if path.is_file()]


def margin_boxes(methods: Mapping[str, Sequence[BalanceTrace]]) -> str:
    """Return the figure of each method's mean CoM margins: median and quartiles, 10 to 90 %, a dot per trial.

    Args:
        methods: name -> traces of its trials, in the order of the methods' colours; without any sample the figure is
            empty text.
    """
    sampled = [[trace.margin for trace in traces if len(trace.margin)] for traces in methods.values()]
    boxes = [(i, name, margins) for i, (name, margins) in enumerate(zip(methods, sampled, strict=True)) if margins]
    if not boxes:
        return ""
    figure = page_figure(FRAME + ROW * len(boxes))
    axes = figure.subplots()
    for y, (i, _, margins) in enumerate(boxes):
        colour, values = method_colour(i), 1e3 * np.array([margin.mean() for margin in margins])
        outside = sum(bool((margin < 0.0).any()) for margin in margins)
        low, q1, median, q3, high = np.quantile(values, (0.1, 0.25, 0.5, 0.75, 0.9))
        axes.plot([low, high], [y, y], color=colour, lw=1.2)
        axes.barh(y, q3 - q1, left=q1, height=0.5, color=colour, alpha=0.3)
        axes.plot([median, median], [y - 0.25, y + 0.25], color=colour, lw=2)
        red = values < 0.0
        for chosen, dot in ((~red, colour), (red, COLOUR["lost"])):
            axes.plot(values[chosen], np.full(int(chosen.sum()), y), ".", color=dot, ms=4, alpha=0.7)
        text = f"{median:.0f} mm, {outside} of {len(values)} below zero once"
        axes.text(1.01, y, text, transform=axes.get_yaxis_transform(), va="center", color=COLOUR["muted"])
    axes.axvline(0.0, color=COLOUR["lost"], lw=1.2)
    axes.set(ylim=(len(boxes) - 0.4, -0.6), xlabel="mean CoM margin of a trial [mm]")
    axes.set_yticks(range(len(boxes)), [name for _, name, _ in boxes])
    axes.grid(axis="y", visible=False)
    return svg(figure, "mean CoM margin of whole trials")


MAX_CURVES = 60
"""Trials that are drawn at most; more would be a black band."""
LEAD = 1.0
"""Time before the push that is shown [s]."""


MarginCurve = tuple[BalanceTrace, bool]
"""One trial of a plot, and whether it was a success."""


def push_start(trace: BalanceTrace) -> float:
    """Return when the push began [s]; the start of the trace where there was no push."""
    pushed = np.flatnonzero(np.linalg.norm(trace.force, axis=1) > 0.0)
    return float(trace.t[pushed[0]] if len(pushed) else trace.t[0])


def margin_plot(curves: Sequence[MarginCurve], color: int) -> str:
    """Return the CoM margins of one method's trials over the time since the push, its force above where there was one.

    The first curve is drawn bold.

    Args:
        curves: the trials; without any sample the figure is empty text.
        color: number of the method's colour.
    """
    shown = [(trace, success) for trace, success in curves[:MAX_CURVES] if len(trace.t)]
    if not shown:
        return ""
    pushed = any(trace.force.any() for trace, _ in shown)
    figure = page_figure(330.0 if pushed else 240.0)
    above, axes = figure.subplots(2, sharex=True, height_ratios=(1, 2.6)) if pushed else (None, figure.subplots())
    colour = method_colour(color)
    for i, (whole, success) in reversed(list(enumerate(shown))):
        start = push_start(whole)
        trace = whole.window(start - LEAD)
        look = {"color": colour, "lw": 2.0 if i == 0 else 0.8, "alpha": 1.0 if i == 0 else 0.4}
        axes.plot(trace.t - start, 1e3 * trace.margin, **look)
        if above is not None:
            above.plot(trace.t - start, np.linalg.norm(trace.force, axis=1), **look)
        if not success:
            axes.plot(trace.t[-1] - start, 1e3 * trace.margin[-1], "x", color=COLOUR["lost"], ms=7, mew=2)
    axes.axhline(0.0, color=COLOUR["lost"], lw=1.2)
    axes.set(xlabel="time since the push [s]" if pushed else "time [s]", ylabel="CoM margin [mm]")
    axes.margins(x=0)
    if above is not None:
        above.set(ylabel="force [N]")
    return svg(figure, "CoM margin over time")
