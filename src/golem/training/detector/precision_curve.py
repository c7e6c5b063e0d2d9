"""Draws the training curve of the detector."""

from __future__ import annotations

import csv
from pathlib import Path

from golem.capabilities.perception.classes import CLASSES
from golem.figures import blank_figure

SIZE = (900, 420)
"""Width and height [px]."""
COLOURS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee")


def draw_curve(curve: Path, out: Path) -> None:
    """Draw average precision over crops seen, per class; head camera solid, palm cameras dashed.

    Args:
        curve: the CSV file that `train` writes.
        out: the PNG file.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with curve.open() as file:
        rows = list(csv.DictReader(file))
    seen = [int(row["images"]) / 1000 for row in rows]
    figure = blank_figure(*SIZE)
    axes = figure.subplots()
    for label, colour in zip(CLASSES, COLOURS, strict=True):
        for camera, dashes in (("head", "-"), ("palm", "--")):
            precision = [float(row[f"ap_{camera}_{label}"]) for row in rows]
            axes.plot(seen, precision, dashes, color=colour, label=label if camera == "head" else None)
    axes.set(ylim=(0.0, 1.0), xlabel="training crops [thousands]", ylabel="average precision")
    axes.set_title("AP on part of the held-out images: head solid, palm dashed", fontsize=10, loc="left")
    axes.grid(color="#dddddd")
    figure.legend(loc="outside right upper", frameon=False)
    figure.savefig(out)
