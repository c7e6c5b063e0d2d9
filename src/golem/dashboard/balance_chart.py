"""How well the robot balances, for people: a strip chart of the CoM margin."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.errors import MissingExtra
from golem.figures import blank_figure, pixels
from golem.robots.mujoco.balance import BalanceTrace

SPAN = 10.0
"""Time the chart goes back [s]."""
REACH = 0.15
"""Margin at the upper edge, and at the lower edge below zero [m]: a still stand has 0.11."""
PANEL, INK, MUTED = "#10141b", "#f0f2f5", "#96a0ad"
GOOD, BAD, PUSHED = "#68c896", "#e84e3c", "#784230"


def balance_chart(trace: BalanceTrace, size: tuple[int, int]) -> NDArray[np.uint8] | None:
    """Return the CoM margin over the last `SPAN` seconds of `trace`, times with a push marked.

    Args:
        trace: samples, at least one.
        size: width and height [px].

    Returns:
        (height, width, 3) RGB; None where matplotlib, which draws it, is not installed.
    """
    width, height = size
    try:
        figure = blank_figure(width, height, facecolor=PANEL, layout=None)
    except MissingExtra:
        return None
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    axes.set(xlim=(-SPAN, 0.0), ylim=(-REACH, REACH))
    shown = trace.window(float(trace.t[-1]) - SPAN)
    t, margin = shown.t - float(trace.t[-1]), np.clip(shown.margin, -REACH, REACH)
    pushed = np.abs(shown.force).any(axis=1)
    axes.fill_between(t, -REACH, REACH, where=pushed, step="mid", color=PUSHED, lw=0)
    axes.axhline(0.0, color=MUTED, lw=0.75)
    for colour, chosen in ((GOOD, margin >= 0.0), (BAD, margin < 0.0)):
        axes.plot(t, np.where(chosen, margin, np.nan), color=colour, lw=1.5)
    word, points = f"{1e3 * float(trace.margin[-1]):+.0f} mm", 0.105 * height
    axes.text(0.02, 0.06, "CoM margin (simulator's truth)", color=MUTED, size=points, transform=axes.transAxes)
    colour = INK if trace.margin[-1] >= 0.0 else BAD
    axes.text(0.98, 0.06, word, color=colour, size=points, ha="right", transform=axes.transAxes)
    return pixels(figure)
