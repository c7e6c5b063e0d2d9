"""The page of `golem table`: one HTML file; the report of each row lies in the row's own folder beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from golem.evaluation.report.html_page import render_page
from golem.evaluation.report.ladder_plots import failure_plot
from golem.evaluation.report.margin_box import MarginBox, kept_traces, margin_box, margin_boxes
from golem.evaluation.report.svg_figure import styled

if TYPE_CHECKING:
    from golem.evaluation.harness.grasp_table import GraspTable


def render_table(table: GraspTable) -> str:
    """Return the page of a finished table as HTML.

    Raises:
        golem.errors.MissingExtra: what draws it is not installed.
    """
    measured = [(line, ladder) for line, ladder in table.rows if ladder is not None]
    first = measured[0][1].records[0] if measured else None
    facts = {} if first is None else {"commit": first.commit, "code": first.code}
    with styled():
        return render_page(
            "table.html",
            facts,
            command=table.config.command(),
            rates=table.rates(),
            absent=table.absent,
            boxes=margin_boxes(_boxes(table)),
            failures=[
                (line.name, failure_plot(ladder.summary, "stages"))
                for line, ladder in measured
                if any(not r.success for r in ladder.records)
            ],
            paired=table.paired(),
            reports=[
                (line.name, f"{line.key}/{ladder.report.name}", sum(not r.success for r in ladder.records))
                for line, ladder in measured
                if ladder.report is not None
            ],
        )


def _boxes(table: GraspTable) -> list[MarginBox]:
    found = [
        margin_box(
            f"{line.name}: {column.head}",
            [t for _, t in kept_traces([r for r in ladder.records if r.method == column.method], ladder.out)],
            number,
        )
        for line, ladder in table.rows
        if ladder is not None
        for number, column in enumerate(table.columns)
    ]
    return [box for box in found if box is not None]
