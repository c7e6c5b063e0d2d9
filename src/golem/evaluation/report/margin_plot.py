"""CoM margin over time, the force of the push above it: the figures of the paper's section on pushes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from golem.evaluation.harness.records import TrialRecord, artefacts
from golem.evaluation.report.svg_figure import COLOUR, method_colour, page_figure, svg
from golem.robots.mujoco.balance import TRACE, BalanceTrace

ROW = 30.0
"""Height of a box with its name [px]."""
FRAME = 70.0
"""Height of what is around the boxes [px]."""


@dataclass(frozen=True, slots=True)
class MarginBox:
    """The trials of one box.

    Attributes:
        margins: mean CoM margin of each trial [m].
        outside: trials whose margin was below zero at any time.
        colour: number of the method's colour.
    """

    name: str
    margins: tuple[float, ...]
    outside: int
    colour: int


def kept_traces(records: Sequence[TrialRecord], folder: Path) -> list[tuple[TrialRecord, BalanceTrace]]:
    """Return the trials in the run `folder` that kept a trace, with it."""
    paths = [(r, artefacts(folder, r) / TRACE) for r in records]
    return [(r, BalanceTrace.load(path)) for r, path in paths if path.is_file()]


def margin_box(name: str, traces: Sequence[BalanceTrace], colour: int) -> MarginBox | None:
    """Return the box of trials with these traces; None where none has a sample."""
    margins = [trace.margin for trace in traces if len(trace.margin)]
    if not margins:
        return None
    means = tuple(float(margin.mean()) for margin in margins)
    return MarginBox(name, means, sum(bool((margin < 0.0).any()) for margin in margins), colour)


def margin_boxes(boxes: Sequence[MarginBox]) -> str:
    """Return the figure: median and quartiles, lines from 10 to 90 %, a dot per trial; empty text without boxes."""
    if not boxes:
        return ""
    figure = page_figure(FRAME + ROW * len(boxes))
    axes = figure.subplots()
    for y, box in enumerate(boxes):
        colour, values = method_colour(box.colour), 1e3 * np.array(box.margins)
        low, q1, median, q3, high = np.quantile(values, (0.1, 0.25, 0.5, 0.75, 0.9))
        axes.plot([low, high], [y, y], color=colour, lw=1.2)
        axes.barh(y, q3 - q1, left=q1, height=0.5, color=colour, alpha=0.3)
        axes.plot([median, median], [y - 0.25, y + 0.25], color=colour, lw=2)
        red = values < 0.0
        for chosen, dot in ((~red, colour), (red, COLOUR["lost"])):
            axes.plot(values[chosen], np.full(int(chosen.sum()), y), ".", color=dot, ms=4, alpha=0.7)
        text = f"{median:.0f} mm, {box.outside} of {len(values)} below zero once"
        axes.text(1.01, y, text, transform=axes.get_yaxis_transform(), va="center", color=COLOUR["muted"])
    axes.axvline(0.0, color=COLOUR["lost"], lw=1.2)
    axes.set(ylim=(len(boxes) - 0.4, -0.6), xlabel="mean CoM margin of a trial [mm]")
    axes.set_yticks(range(len(boxes)), [box.name for box in boxes])
    axes.grid(axis="y", visible=False)
    return svg(figure, "mean CoM margin of whole trials")


MAX_CURVES = 60
"""Trials that are drawn at most; more would be a black band."""
LEAD = 1.0
"""Time before the push that is shown [s]."""


@dataclass(frozen=True, slots=True)
class MarginCurve:
    """One trial of a plot."""

    trace: BalanceTrace
    success: bool


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
    shown = [curve for curve in curves[:MAX_CURVES] if len(curve.trace.t)]
    if not shown:
        return ""
    pushed = any(curve.trace.force.any() for curve in shown)
    figure = page_figure(330.0 if pushed else 240.0)
    above, axes = figure.subplots(2, sharex=True, height_ratios=(1, 2.6)) if pushed else (None, figure.subplots())
    colour = method_colour(color)
    for i, curve in reversed(list(enumerate(shown))):
        start = push_start(curve.trace)
        trace = curve.trace.window(start - LEAD)
        look = {"color": colour, "lw": 2.0 if i == 0 else 0.8, "alpha": 1.0 if i == 0 else 0.4}
        axes.plot(trace.t - start, 1e3 * trace.margin, **look)
        if above is not None:
            above.plot(trace.t - start, np.linalg.norm(trace.force, axis=1), **look)
        if not curve.success:
            axes.plot(trace.t[-1] - start, 1e3 * trace.margin[-1], "x", color=COLOUR["lost"], ms=7, mew=2)
    axes.axhline(0.0, color=COLOUR["lost"], lw=1.2)
    axes.set(xlabel="time since the push [s]" if pushed else "time [s]", ylabel="CoM margin [mm]")
    axes.margins(x=0)
    if above is not None:
        above.set(ylabel="force [N]")
    return svg(figure, "CoM margin over time")
