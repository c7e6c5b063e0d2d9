"""The plots of the report, as inline SVG that takes its colours from the page's style sheet."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from golem.evaluation.metrics.statistics import Interval

WIDTH = 860
"""Width of a full-width plot in SVG units; the page scales it."""
GUTTER = 130
"""Room for row names at the left."""


@dataclass(frozen=True, slots=True)
class Dot:
    """One trial in a strip plot: its value, whether the trial succeeded, and what a hover says."""

    value: float
    success: bool
    title: str


def tag(name: str, content: str = "", /, **attributes: str | float) -> str:
    """Return one SVG element; `cls` becomes `class`, underscores become hyphens, numbers two decimals."""
    parts = []
    for key, value in attributes.items():
        shown = f"{value:.2f}".rstrip("0").rstrip(".") if isinstance(value, float) else str(value)
        parts.append(f' {"class" if key == "cls" else key.replace("_", "-")}="{escape(shown)}"')
    return f"<{name}{''.join(parts)}>{content}</{name}>"


def text(x: float, y: float, words: str, cls: str = "", anchor: str = "start") -> str:
    """Return `words` at a point; `anchor` is start, middle or end."""
    return tag("text", escape(words), x=float(x), y=float(y), cls=cls, text_anchor=anchor)


def line(x1: float, y1: float, x2: float, y2: float, cls: str) -> str:
    """Return a straight line."""
    return tag("line", x1=float(x1), y1=float(y1), x2=float(x2), y2=float(y2), cls=cls)


def rect(x: float, y: float, width: float, height: float, cls: str, title: str = "") -> str:
    """Return a rectangle; a hover says `title`."""
    tip = tag("title", escape(title)) if title else ""
    return tag("rect", tip, x=float(x), y=float(y), width=float(width), height=float(height), cls=cls)


def polyline(points: Sequence[tuple[float, float]], cls: str, title: str = "") -> str:
    """Return a line through `points`; a hover says `title`."""
    tip = tag("title", escape(title)) if title else ""
    return tag("polyline", tip, points=" ".join(f"{x:.1f},{y:.1f}" for x, y in points), cls=cls)


def svg(width: float, height: float, content: str, label: str) -> str:
    """Return a whole drawing, which says `label` to those who cannot see it."""
    return tag("svg", content, viewBox=f"0 0 {width:g} {height:g}", role="img", aria_label=label)


def ticks(low: float, high: float, about: int = 6) -> list[float]:
    """Return round numbers, steps of 1, 2 or 5 times a power of ten, that cover `low` to `high`; at least two."""
    high = high if high - low > 1e-9 else low + 1.0
    span = high - low
    power = 10.0 ** math.floor(math.log10(span / about))
    step = next(s * power for s in (1, 2, 5, 10) if span / (s * power) <= about)
    return [i * step for i in range(math.floor(low / step), math.ceil(high / step) + 1)]


def interval_bar(
    rate: float, interval: Interval, color: int, paper: Sequence[tuple[float, Interval, str]]
) -> str:
    """Return a success rate with its interval on 0 to 100 %, and published ones as thin marks below it.

    Args:
        rate: success rate, 0 to 1.
        interval: its interval, 0 to 1.
        color: number of the method's colour.
        paper: published rate, interval and description of each.
    """
    width, lane = 400, 15
    height = 30 + lane * len(paper)

    def x(value: float) -> float:
        return 8 + (width - 16) * value

    parts = [line(x(g / 4), 0, x(g / 4), height, "grid") for g in range(5)]
    parts.append(rect(x(interval.low), 10, x(interval.high) - x(interval.low), 10, f"band m{color}"))
    parts.append(rect(x(rate) - 2.5, 5, 5, 20, f"fill m{color}"))
    for row, (published, bounds, label) in enumerate(paper):
        y = 34 + lane * row
        tip = tag("title", escape(label))
        parts.append(line(x(bounds.low), y, x(bounds.high), y, "paper"))
        parts.append(tag("circle", tip, cx=x(published), cy=float(y), r=3.5, cls="paperdot"))
    return svg(width, height, "".join(parts), f"{100 * rate:.1f} percent")


def percent_axis() -> str:
    """Return the axis that stands above `interval_bar`."""
    marks = [
        text(8 + 384 * g / 4, 12, f"{25 * g}", "tick", ("start", "middle", "middle", "middle", "end")[g])
        for g in range(5)
    ]
    return svg(400, 16, "".join(marks), "0 to 100 percent")


def stacked(rows: Mapping[str, Mapping[str, int]], totals: Mapping[str, int], names: Sequence[str]) -> str:
    """Return one bar per method, its failures stacked by cause, on the scale of all its trials.

    Args:
        rows: method -> cause -> failures.
        totals: method -> trials.
        names: the causes in the order of the colours.
    """
    parts, pitch = [], 40
    scale = (WIDTH - GUTTER - 80) / max(totals.values())
    for i, (method, causes) in enumerate(rows.items()):
        y, x = 8 + pitch * i, float(GUTTER)
        parts.append(text(GUTTER - 12, y + 17, method, "name", "end"))
        parts.append(rect(GUTTER, y, totals[method] * scale, 24, "track"))
        for cause, count in sorted(causes.items(), key=lambda item: names.index(item[0])):
            width = count * scale
            parts.append(rect(x, y, width, 24, f"cause s{names.index(cause) % 8}", f"{cause}: {count}"))
            if width > 22:
                parts.append(text(x + width / 2, y + 16.5, str(count), "inbar", "middle"))
            x += width
        lost = sum(causes.values())
        parts.append(text(GUTTER + totals[method] * scale + 8, y + 17, f"{lost} of {totals[method]}", "tick"))
    return svg(WIDTH, 12 + pitch * len(rows), "".join(parts), "failures by cause")


def trial_map(rows: Mapping[str, Sequence[tuple[bool, str]]]) -> str:
    """Return a grid with a column per trial and a row per method, in blocks of 50 trials.

    Args:
        rows: method -> per trial whether it succeeded, and what a hover says.
    """
    n = max(len(cells) for cells in rows.values())
    block, cell = 50, (WIDTH - GUTTER) / 50
    parts, y = [], 0.0
    for start in range(0, n, block):
        parts.append(text(GUTTER, y + 11, f"trial {start}", "tick"))
        y += 16
        for method, cells in rows.items():
            parts.append(text(GUTTER - 12, y + cell - 3, method, "name", "end"))
            for column, (success, title) in enumerate(cells[start : start + block]):
                cls = "won" if success else "lost"
                parts.append(rect(GUTTER + column * cell + 0.75, y, cell - 1.5, cell - 1.5, cls, title))
            y += cell + 1
        y += 8
    return svg(WIDTH, y, "".join(parts), "outcome of each trial")


def strips(rows: Mapping[str, Sequence[Dot]], unit: str) -> str:
    """Return per method all values as dots, with median and quartiles as a box and 10 to 90 % whiskers.

    Args:
        rows: method -> its dots; at least one of all has to be there.
        unit: what the axis says.
    """
    values = [dot.value for dots in rows.values() for dot in dots]
    marks = ticks(min(0.0, *values), max(values))
    low, high = marks[0], marks[-1]
    pitch, bottom = 64, 8 + 64 * len(rows)

    def x(value: float) -> float:
        return GUTTER + (WIDTH - GUTTER - 30) * (value - low) / (high - low)

    parts = [line(x(mark), 4, x(mark), bottom, "grid") for mark in marks]
    parts += [text(x(mark), bottom + 16, f"{mark:g}", "tick", "middle") for mark in marks]
    parts.append(text(GUTTER - 12, bottom + 16, unit, "tick", "end"))
    for i, (method, dots) in enumerate(rows.items()):
        middle = 8 + pitch * i + pitch / 2
        parts.append(text(GUTTER - 12, middle + 5, method, "name", "end"))
        if not dots:
            parts.append(text(GUTTER + 8, middle + 5, "no trial reached it", "tick"))
            continue
        p10, q1, median, q3, p90 = (
            x(q) for q in np.percentile([dot.value for dot in dots], (10, 25, 50, 75, 90))
        )
        parts.append(line(p10, middle - 12, p90, middle - 12, f"whisker m{i % 6}"))
        parts.append(rect(q1, middle - 19, max(q3 - q1, 1), 14, f"box m{i % 6}"))
        parts.append(line(median, middle - 22, median, middle - 2, f"median m{i % 6}"))
        for k, dot in enumerate(dots):
            # The golden ratio spreads neighbours over the lane, the same way each time.
            y = middle + 6 + 16 * ((k * 0.618034) % 1)
            cls = f"dot m{i % 6}" if dot.success else f"dot hollow m{i % 6}"
            parts.append(
                tag("circle", tag("title", escape(dot.title)), cx=x(dot.value), cy=y, r=3.2, cls=cls)
            )
    return svg(WIDTH, bottom + 24, "".join(parts), f"distribution in {unit}")
