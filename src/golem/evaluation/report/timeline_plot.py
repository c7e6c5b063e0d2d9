"""Timelines of what a memory believed of objects, for the report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from golem.evaluation.episodes.memory_timeline import ObjectTimeline
from golem.evaluation.report.svg_figure import COLOUR
from golem.true_runs import true_runs

ROW = 0.29
"""Height of a row [inch]."""


def timeline_plot(episodes: Mapping[str, tuple[Sequence[ObjectTimeline], int]], figure: Any) -> None:
    """Draw one axis per episode, a row per object, looks from left to right.

    Args:
        episodes: title -> its rows, and how many looks there were before the move.
        figure: of matplotlib; its height is set.
    """
    rows = sum(len(found) for found, _ in episodes.values())
    figure.set_figheight(ROW * rows + 0.75 * len(episodes) + 0.7)
    ratios = [len(found) + 0.6 for found, _ in episodes.values()]
    every = figure.subplots(len(episodes), squeeze=False, gridspec_kw={"height_ratios": ratios})[:, 0]
    for axes, (title, (found, split)) in zip(every, episodes.items(), strict=True):
        _draw(axes, found, split)
        axes.set_title(title)
    every[-1].set_xlabel("look")
    marks = [
        every[-1].barh(0, 0, color=COLOUR["track"], label="it stands there"),
        every[-1].barh(0, 0, color=COLOUR["m0"], label="remembered as there"),
        every[-1].barh(0, 0, color=COLOUR["m0"], alpha=0.3, label="remembered as gone"),
        every[-1].plot([], [], "|", color=COLOUR["ink"], label="found in the image")[0],
        every[-1].plot([], [], "o", ms=4, color=COLOUR["won"], label="told where it is")[0],
        every[-1].plot([], [], "x", ms=5, color=COLOUR["lost"], label="told wrongly")[0],
    ]
    figure.legend(handles=marks, loc="outside lower center", ncols=3, labelcolor=COLOUR["ink"], fontsize=9)


def _draw(axes: Any, rows: Sequence[ObjectTimeline], split: int) -> None:
    looks = len(rows[0].beliefs)
    for y, row in enumerate(rows):
        axes.broken_barh(_spans(row.present), (y - 0.4, 0.8), color=COLOUR["track"], linewidth=0)
        for belief, alpha in (("there", 1.0), ("gone", 0.3)):
            held = _spans([one == belief for one in row.beliefs])
            axes.broken_barh(held, (y + 0.03, 0.3), color=COLOUR["m0"], alpha=alpha, linewidth=0)
        axes.plot([k + 0.5 for k in row.seen], [y + 0.18] * len(row.seen), "|", ms=8, color=COLOUR["ink"])
        for right, mark, colour in ((True, "o", "won"), (False, "x", "lost")):
            at = [k + 0.5 for k, told in enumerate(row.told) if told is right]
            axes.plot(at, [y - 0.2] * len(at), mark, ms=4 if right else 5, color=COLOUR[colour])
    axes.axvline(split, color=COLOUR["muted"], lw=1, ls="--")
    axes.set(xlim=(0, looks), ylim=(len(rows) - 0.45, -0.55))
    axes.set_yticks(range(len(rows)), [row.name for row in rows])
    axes.grid(axis="y", visible=False)


def _spans(flags: ArrayLike) -> list[tuple[int, int]]:
    """Return first look and length of each run of true `flags` (n,): bars of one look each show seams."""
    return [(first, end - first) for first, end in true_runs(flags).tolist()]
