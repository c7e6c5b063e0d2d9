"""What a pick said at the end, against what was possible: refusals are right where nothing could be done."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from golem.evaluation.base import TrialOutcome
from golem.evaluation.episodes.pick_claims import REFUSALS
from golem.evaluation.metrics.text_table import TextTable
from golem.skills.pick_report import PickOutcome, PickReport

SAID = "said_"
"""Begins the name of the figure that says how a pick ended, by its own word."""


def verdict(said: PickReport, success: bool, doable: bool) -> dict[str, float]:
    """Return how a trial ended, as figures.

    Args:
        said: what the pick reports.
        success: whether a screw is in the tray.
        doable: whether a hand reaches a loose screw and the tray.
    """
    series = {f"{SAID}{said.outcome}": 1.0, "doable": float(doable)}
    if said.outcome in REFUSALS and not success:
        series["refusal_right"] = float(not doable)
    return series


def verdict_tables(outcomes: Mapping[str, Sequence[TrialOutcome]]) -> list[TextTable]:
    """Return one table per method: what was said, how often, and whether it was so."""
    return [_table(method, rows) for method, rows in outcomes.items() if rows]


def _table(method: str, rows: Sequence[TrialOutcome]) -> TextTable:
    lines: list[tuple[str, ...]] = []
    for outcome in PickOutcome:
        mine = [row for row in rows if f"{SAID}{outcome.value}" in row.series]
        if not mine:
            continue
        could = [row for row in mine if row.series["doable"]]
        refusal = outcome in REFUSALS
        in_tray = sum(row.success for row in mine)
        right = len(mine) - len(could) if refusal else in_tray
        wrong = str(len(mine) - right)
        counts = (str(len(mine)), str(len(could)), str(in_tray))
        lines.append((outcome.value, *counts, str(right), wrong))
    return TextTable(
        f"What {method} said at the end",
        ("said", "trials", "could be done", "in the tray", "right", "wrong"),
        tuple(lines),
        "Could be done: by the simulator's truth, a hand reaches a loose screw and the tray. A refusal is right where "
        "it could not; anything else where a screw is in the tray.",
    )
