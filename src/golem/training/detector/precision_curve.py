"""Draws the training curve of a detector."""

from __future__ import annotations

import csv
from pathlib import Path

from golem.figures import blank_figure

SIZE = (1000, 420)
"""Width and height [px]."""


def draw_curve(curve: Path, out: Path) -> None:
    """Draw average precision over crops seen, per class, one panel per camera.

    Args:
        curve: the CSV file that `train` writes; its columns `ap_CAMERA_CLASS` are drawn.
        out: the PNG file.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    with curve.open() as file:
        rows = list(csv.DictReader(file))
    seen = [int(row["images"]) / 1000 for row in rows]
    columns = [name.split("_", 2)[1:] for name in rows[0] if name.startswith("ap_")]
    cameras = list(dict.fromkeys(camera for camera, _ in columns))
    figure = blank_figure(*SIZE)
    panels = figure.subplots(1, len(cameras), sharey=True, squeeze=False)[0]
    for camera, axes in zip(cameras, panels, strict=True):
        for label in (label for one, label in columns if one == camera):
            axes.plot(seen, [float(row[f"ap_{camera}_{label}"]) for row in rows], ".-", label=label)
        axes.set(ylim=(0.0, 1.0), xlabel="training crops [thousands]", title=camera)
        axes.grid(color="#dddddd")
    panels[0].set(ylabel="AP on part of the held-out images")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right upper", frameon=False)
    figure.savefig(out)
