"""Pages by jinja2, and their figures as inline SVG in the colours of the page's style sheet, light or dark."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from golem.errors import needs
from golem.evaluation.metrics.statistics import wilson
from golem.evaluation.metrics.text_table import short_names
from golem.figures import blank_figure
from golem.package_data import load_data
from golem.robots.worlds.conditions import CHOICES, RANGES, Conditions


def render_page(template: str, facts: dict[str, str], **values: Any) -> str:
    """Return the page that a template makes of `values`, `facts` at its end. Raises MissingExtra: no jinja2."""
    with needs("jinja2", "report"):
        import jinja2  # noqa: F401
    return _pages().get_template(template).render(css=style(), facts=facts, **values)


@cache
def style() -> str:
    """Return the style sheet of every page."""
    return resources.files("golem.evaluation.report").joinpath("report.css").read_text(encoding="utf-8")


@cache
def _pages() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader("golem.evaluation.report")
    return Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)


WIDTH = 900.0
"""Width of a figure over the whole page [px]; the page scales it."""
_NAMES = ("ink", "muted", "line", "track", "won", "lost", *(f"m{i}" for i in range(6)), *(f"s{i}" for i in range(8)))
COLOUR = {name: f"#0000{i + 1:02x}" for i, name in enumerate(_NAMES)}
"""Variable of the style sheet -> the colour that stands for it in a figure."""
_VARIABLE = {code: f"var(--{name})" for name, code in COLOUR.items()}
_STYLE = {key: COLOUR.get(value, value) for key, value in load_data(__package__, "figure.yaml").items()}


def method_colour(i: int) -> str:
    """Return the colour of method number `i`."""
    return COLOUR[f"m{i % 6}"]


def cause_colour(i: int) -> str:
    """Return the colour of cause number `i` of failures."""
    return COLOUR[f"s{i % 8}"]


def styled() -> Any:
    """Return the context in which figures of the page are drawn. Raises MissingExtra: matplotlib is not installed."""
    with needs("matplotlib", "report"):
        import matplotlib
    return matplotlib.rc_context(_STYLE)


def page_figure(height: float) -> Any:
    """Return an empty figure of the page; call it, and `svg`, within `styled`."""
    return blank_figure(WIDTH, height, facecolor="none")


def svg(figure: Any, label: str) -> str:
    """Return a figure as SVG, which says `label` to those who cannot see it."""
    for axes in figure.axes:
        axes.set_facecolor("none")
    stream = io.StringIO()
    figure.savefig(stream, format="svg", facecolor="none", metadata={"Date": None, "Creator": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"#0000[0-1][0-9a-f]\b", lambda match: _VARIABLE.get(match[0], match[0]), text)
    text = re.sub(r"font-family: [^;\"]*", "font-family: inherit", text)
    size = re.search(r'viewBox="[^"]*"', text)
    assert size is not None
    return re.sub(r"<svg[^>]*>", f'<svg {size[0]} role="img" aria-label="{label}">', text, count=1)


def standalone(picture: str) -> str:
    """Return a figure of the page as the text of an SVG file, in the colours of the page by day."""
    colours = dict(reversed(re.findall(r"--(\w+):\s*(#[0-9a-fA-F]+)", style())))  # the first of each name is by day
    picture = re.sub(r"var\(--(\w+)\)", lambda match: colours[match[1]], picture)
    names = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    picture = picture.replace("font-family: inherit", "font-family: sans-serif")
    return f'<?xml version="1.0" encoding="utf-8"?>\n{picture.replace("<svg ", f"<svg {names} ", 1)}\n'


PARTS = 4
"""Parts that the range of a number is cut into: each holds as many trials as the next, as far as that goes."""
COLUMNS = 4

Placed = tuple[Conditions, bool]
"""One trial: its work place, and whether it succeeded."""


@dataclass(frozen=True, slots=True)
class Part:
    """Trials of one value of a condition, or of one part of its range."""

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
