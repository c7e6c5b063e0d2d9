"""Success by the conditions of varied work places: each condition cut into parts, the others as they were drawn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.text_table import short_names
from golem.evaluation.report.svg_figure import method_colour
from golem.robots.worlds.conditions import CHOICES, RANGES, Conditions

PARTS = 4
"""Parts that the range of a number is cut into: each holds as many trials as the next, as far as that goes."""
COLUMNS = 4

Placed = tuple[Conditions, bool]
"""One trial: its work place, and whether it succeeded."""


@dataclass(frozen=True, slots=True)
class Part:
    """Trials of one value of a condition, or of one part of its range.

    Attributes:
        condition: its name.
        name: the value, or the part's ends.
        won, n: trials that succeeded, and all.
    """

    condition: str
    name: str
    won: int
    n: int


def parts(trials: Sequence[Placed]) -> list[Part]:
    """Return the trials by each condition in turn."""
    found: list[Part] = []
    for condition in (*RANGES, *CHOICES):
        values = [getattr(place, condition) for place, _ in trials]
        won = np.array([success for _, success in trials], bool)
        if condition in CHOICES:
            named = {value: [v == value for v in values] for value in CHOICES[condition]}
        else:
            numbers = np.array(values, float)
            cuts = np.quantile(numbers, np.linspace(0.0, 1.0, PARTS + 1)[1:-1])
            which = np.digitize(numbers, cuts)
            named = {
                f"{numbers[which == k].min():.3g} to {numbers[which == k].max():.3g}": which == k
                for k in range(PARTS)
                if (which == k).any()
            }
        for name, mine in named.items():
            n = int(np.sum(mine))
            if n:
                found.append(Part(condition, name, int(won[mine].sum()), n))
    return found


def condition_plot(grouped: Mapping[str, Sequence[Placed]], figure: Any) -> None:
    """Draw success by condition on an empty figure: points with Wilson intervals, a panel per condition."""
    names = (*RANGES, *CHOICES)
    figure.set_figheight(1.6 * figure.get_figheight())
    panels = figure.subplots(-(-len(names) // COLUMNS), COLUMNS, sharey=True, squeeze=False).ravel()
    for panel in panels[len(names) :]:
        panel.set_axis_off()
    short = short_names(grouped)
    for m, (method, trials) in enumerate(grouped.items()):
        by_condition = parts(trials)
        for panel, name in zip(panels, names, strict=False):
            mine = [part for part in by_condition if part.condition == name]
            for x, part in enumerate(mine):
                label = short[method] if panel is panels[0] and x == 0 else None
                draw_share(panel, x + 0.15 * m, part.won, part.n, method_colour(m), label)
            labels = [part.name.replace(" to ", "\nto ").replace("_", "\n") for part in mine]
            panel.set_xticks(range(len(mine)), labels, fontsize=6)
            panel.set(title=name.replace("_", " "), ylim=(0, 103))
    figure.legend(loc="outside lower center", ncols=3)


def draw_share(panel: Any, x: float, won: int, n: int, colour: str, label: str | None = None) -> None:
    """Draw `won` of `n` at `x` as a point in percent, with its Wilson interval."""
    interval = wilson(won, n)
    panel.plot([x, x], [100 * interval.low, 100 * interval.high], color=colour, lw=2)
    panel.plot(x, 100 * won / n, "o", ms=4, color=colour, label=label)
