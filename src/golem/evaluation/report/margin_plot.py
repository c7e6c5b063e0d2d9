"""CoM margin over time, the force of the push above it: the figures of the paper's section on pushes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.evaluation.report.svg_figure import COLOUR, method_colour, page_figure, svg
from golem.robots.mujoco.balance import BalanceTrace

MAX_CURVES = 60
"""Trials that are drawn at most; more would be a black band."""
LEAD = 1.0
"""Time before the push that is shown [s]."""


@dataclass(frozen=True, slots=True)
class MarginCurve:
    """One trial of a plot.

    Attributes:
        trace: its samples.
        success: whether it succeeded; others end with a cross.
    """

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
    if pushed:
        above, axes = figure.subplots(2, sharex=True, height_ratios=(1, 2.6))
    else:
        above, axes = None, figure.subplots()
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
