"""How well the robot balances, for people: a strip chart of the CoM margin, and a section of a report."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from golem.evaluation.report.margin_plot import MarginCurve, margin_plot
from golem.robots.mujoco.balance import BalanceTrace

SPAN = 10.0
"""Time the chart goes back [s]."""
REACH = 0.15
"""Margin at the upper edge, and at the lower edge below zero [m]: a still stand has 0.11."""
PANEL, INK, MUTED = (16, 20, 27), (240, 242, 245), (150, 160, 173)
GOOD, BAD, PUSHED = (104, 200, 150), (232, 78, 60), (120, 66, 48)


def balance_chart(trace: BalanceTrace, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return the CoM margin over the last `SPAN` seconds of `trace`, times with a push marked.

    Args:
        trace: samples, at least one.
        size: width and height [px].

    Returns:
        (height, width, 3) RGB.
    """
    width, height = size
    image = Image.new("RGB", size, PANEL)
    draw = ImageDraw.Draw(image)
    now = float(trace.t[-1])
    shown = trace.window(now - SPAN)
    x = (width - 1) * (1.0 - (now - shown.t) / SPAN)
    y = 0.5 * (height - 1) * (1.0 - np.clip(shown.margin / REACH, -1.0, 1.0))
    for column in x[np.abs(shown.force).any(axis=1)]:
        draw.line((column, 0, column, height), fill=PUSHED, width=2)
    middle = 0.5 * (height - 1)
    draw.line((0, middle, width, middle), fill=MUTED)
    for inside, colour in ((True, GOOD), (False, BAD)):
        chosen = (shown.margin >= 0.0) == inside
        for start, end in _runs(chosen):
            # One sample more closes the gap to the neighbour of the other colour.
            points = np.column_stack([x, y])[max(start - 1, 0) : end]
            draw.line([(float(a), float(b)) for a, b in points], fill=colour, width=2)
    font = ImageFont.load_default(size=max(9, round(0.17 * height)))
    margin = float(trace.margin[-1])
    edge, bottom = round(0.08 * height), height - round(0.05 * height)
    draw.text((edge, bottom), "CoM margin (simulator's truth)", fill=MUTED, font=font, anchor="ld")
    word = f"{1e3 * margin:+.0f} mm"
    draw.text((width - edge, bottom), word, fill=INK if margin >= 0.0 else BAD, font=font, anchor="rd")
    return np.asarray(image)


def balance_figures(trace: BalanceTrace, pushed_at: float | None) -> dict[str, float]:
    """Return how the robot balanced at work, and after the push that began at `pushed_at` [s] if there was one.

    Returns:
        SI units: least CoM margin, horizontal range of the base and steps; with the prefix `push_` after the push.
    """
    work = trace.window(-math.inf, math.inf if pushed_at is None else pushed_at)
    figures = {
        "margin_min": float(work.margin.min()),
        "base_range": work.base_range,
        "steps": work.steps,
    }
    if pushed_at is not None:
        after = trace.window(pushed_at)
        figures |= {
            "push_margin_min": float(after.margin.min()),
            "push_margin_final": after.final_margin,
            "push_steps": after.steps,
        }
    return {name: round(value, 4) for name, value in figures.items()}


def balance_section(trace: BalanceTrace, pushed_at: float | None, figures: Mapping[str, float]) -> str:
    """Return the report's section on the CoM margin as HTML, with the `figures` of `balance_figures`."""
    work = trace.window(-math.inf, math.inf if pushed_at is None else pushed_at)
    steps = f"{figures['steps']:.0f} step{'' if figures['steps'] == 1 else 's'}"
    parts = [
        f"<p>At work the projected centre of mass stayed {1e3 * figures['margin_min']:.0f} mm or more inside the edge "
        f"of the support polygon; the pelvis moved within {1e3 * figures['base_range']:.0f} mm; {steps}.</p>",
        margin_plot([MarginCurve(work, True, "at work")], 0),
    ]
    if pushed_at is not None:
        parts += [
            f"<h3>A push at the end</h3><p>Least margin {1e3 * figures['push_margin_min']:.0f} mm: during a step the "
            f"polygon is one foot. {figures['push_steps']:.0f} steps; "
            f"{1e3 * figures['push_margin_final']:.0f} mm at the end.</p>",
            margin_plot([MarginCurve(trace.window(pushed_at - 1.0), True, "after the push")], 1),
        ]
    note = '<p class="note">Margin over time, read from the simulator: the robot itself does not know it.</p>'
    return f'<h2>Balance</h2><section class="card">{"".join(parts)}{note}</section>'


def _runs(values: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return begin and end of the runs of true `values`."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], values, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
