"""Draws the training curve of the scorer."""

from __future__ import annotations

import csv
from pathlib import Path

from golem.figures import blank_figure

SIZE = (800, 380)
"""Width and height [px]."""
LINES = {
    "auc_held_out": ("held-out wares", "#4477aa", "-"),
    "auc_train": ("training wares", "#4477aa", ":"),
    "auc_proposer": ("antipodal's own score, held-out", "#ee6677", "--"),
}
"""Columns of the curve, and how they are drawn."""


def draw_curve(curve: Path, out: Path) -> None:
    """Draw the area under the ROC curve over epochs.

    Args:
        curve: the CSV file that `train` writes.
        out: the PNG file.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    figure = blank_figure(*SIZE)
    with curve.open() as file:
        rows = list(csv.DictReader(file))
    epochs = [int(row["epoch"]) for row in rows]
    axes = figure.subplots()
    for column, (label, colour, dashes) in LINES.items():
        axes.plot(epochs, [float(row[column]) for row in rows], dashes, color=colour, label=label)
    axes.set(ylim=(0.5, 1.0), xlabel="epoch", ylabel="AUC")
    axes.set_title("Held or not: area under the ROC curve", fontsize=10, loc="left")
    axes.grid(color="#dddddd")
    axes.legend(loc="lower right", frameon=False)
    figure.savefig(out)
