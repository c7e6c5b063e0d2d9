"""CoM margin over time as inline SVG, the force of the push above it: the plots of the paper's figure on pushes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from golem.evaluation.report.svg import WIDTH, line, polyline, rect, svg, text, ticks
from golem.robots.mujoco.balance import BalanceTrace
from golem.types import Array

LEFT, RIGHT = 64, 16
"""Room beside the axes in SVG units."""
FORCE_HEIGHT, MARGIN_HEIGHT, GAP = 70, 190, 14
"""Heights of the two plots, and the room between them."""
MOST = 60
"""So many trials are drawn; more would be a black band."""
LEAD = 1.0
"""Time before the push that is shown [s]."""


@dataclass(frozen=True, slots=True)
class MarginCurve:
    """One trial of a plot.

    Attributes:
        trace: its samples.
        success: whether it succeeded; others end with a cross.
        title: what a hover says.
    """

    trace: BalanceTrace
    success: bool
    title: str


def push_start(trace: BalanceTrace) -> float:
    """Return when the push began [s]; the start of the trace where nobody pushed."""
    pushed = np.flatnonzero(np.linalg.norm(trace.force, axis=1) > 0.0)
    return float(trace.t[pushed[0]] if len(pushed) else trace.t[0])


def margin_plot(courses: Sequence[MarginCurve], color: int) -> str:
    """Return the CoM margins of one method's trials over the time since the push, its force above where there was one.

    The first course is drawn bold.

    Args:
        courses: at least one trial.
        color: number of the method's colour.
    """
    shown = [_Shown(c) for c in courses[:MOST] if len(c.trace.t)]
    if not shown:
        return ""
    pushed = any(s.force.any() for s in shown)
    top = FORCE_HEIGHT + GAP if pushed else 0
    times = ticks(min(s.t[0] for s in shown), max(s.t[-1] for s in shown), 9)
    span = min(s.t[0] for s in shown), max(s.t[-1] for s in shown)
    margin = _Axis(np.concatenate([s.margin for s in shown] + [np.zeros(1)]), top, MARGIN_HEIGHT)
    bottom = top + MARGIN_HEIGHT

    def x(t: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (t - span[0]) / max(span[1] - span[0], 1e-9)

    inside = [t for t in times if span[0] <= t <= span[1]]
    parts = [line(x(t), 0, x(t), bottom, "grid") for t in inside]
    parts += [text(x(t), bottom + 16, f"{t:g}", "tick", "middle") for t in inside]
    parts.append(text(WIDTH - RIGHT, bottom + 30, "seconds", "tick", "end"))
    if pushed:
        force = _Axis(np.concatenate([s.force for s in shown]), 0, FORCE_HEIGHT)
        end = max(float(s.t[s.force > 0.0][-1]) for s in shown if s.force.any())
        parts.append(rect(x(0.0), 0, x(end) - x(0.0), bottom, "pushed"))
        parts += force.drawn("N")
        parts += [_curve(s, s.force, x, force, color, i == 0) for i, s in reversed(list(enumerate(shown)))]
    parts += margin.drawn("mm")
    parts.append(line(LEFT, margin.y(0.0), WIDTH - RIGHT, margin.y(0.0), "zero"))
    parts += [_curve(s, s.margin, x, margin, color, i == 0) for i, s in reversed(list(enumerate(shown)))]
    parts += [_cross(x(s.t[-1]), margin.y(s.margin[-1])) for s in shown if not s.success]
    return svg(WIDTH, bottom + 34, "".join(parts), "CoM margin over time")


class _Shown:
    """A course as it is plotted: times since the push [s], margins [mm], size of the force [N]."""

    def __init__(self, course: MarginCurve) -> None:
        start = push_start(course.trace)
        trace = course.trace.window(start - LEAD)
        self.t: Array = trace.t - start
        self.margin: Array = 1e3 * trace.margin
        self.force: Array = np.linalg.norm(trace.force, axis=1)
        self.success, self.title = course.success, course.title


class _Axis:
    """A vertical axis over `values`, `height` high, its upper end at `top`."""

    def __init__(self, values: Array, top: float, height: float) -> None:
        marks = ticks(min(0.0, float(values.min())), max(float(values.max()), 1.0), 4)
        self._low, self._high, self._marks = marks[0], marks[-1], marks
        self._top, self._height = top, height

    def y(self, value: float) -> float:
        return self._top + self._height * (self._high - value) / (self._high - self._low)

    def drawn(self, unit: str) -> list[str]:
        lines = [line(LEFT, self.y(m), WIDTH - RIGHT, self.y(m), "grid") for m in self._marks]
        words = [text(LEFT - 8, self.y(m) + 4, f"{m:g}", "tick", "end") for m in self._marks]
        return [*lines, *words, text(14, self._top + self._height / 2, unit, "name", "middle")]


def _curve(
    shown: _Shown, values: Array, x: Callable[[float], float], axis: _Axis, color: int, bold: bool
) -> str:
    points = [(x(t), axis.y(v)) for t, v in zip(shown.t[::2], values[::2], strict=True)]
    weight = "bold" if bold else "thin"
    return polyline(points, f"course {weight} m{color}", shown.title)


def _cross(x: float, y: float) -> str:
    return line(x - 4, y - 4, x + 4, y + 4, "lostmark") + line(x - 4, y + 4, x + 4, y - 4, "lostmark")
