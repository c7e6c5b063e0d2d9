"""Draws learning curves."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from golem.errors import ConfigError
from golem.figures import blank_figure
from golem.training.legs.checkpoint import CURVE, read_curve

PANELS = (
    ("survival", "how much of its episode a robot survives", 1.0),
    ("error_moving", "velocity error while walking [m/s]", 0.7),
    ("push", "pushes, share of the largest", 1.0),
    ("amplitude", "upper-body motions, share of the range", 1.0),
)
"""Column, title and top of the axis of each panel."""
SIZE = (360, 300)
"""Width and height of a panel [px]."""
KEPT = (
    *("steps", "cpu_s", "falls", "error_moving", "error_standing", "survival"),
    *("push", "amplitude", "payload", "std"),
)
"""Columns of the table beside the picture."""
THIN = 5
"""Updates per row of it."""
SMOOTH = 10
"""Updates whose mean is drawn: few episodes end in one."""
COLOURS = ("#4477aa", "#ee6677", "#228833", "#ccbb44", "#66ccee", "#aa3377", "#888888", "#000000")


def draw_curves(runs: Sequence[Path], out: Path) -> None:
    """Draw what the run folders' curves say, one colour a run, over millions of steps, and tabulate every fifth update.

    Raises:
        MissingExtra: matplotlib is not installed.
        ConfigError: more runs than colours, two of one name, no such curve, `out` is no PNG file, or the table would
            replace a run's own.
    """
    if out.suffix != ".png":
        raise ConfigError(f"The picture is a file that ends in .png, not {out}; the table goes beside it.")
    table = out.with_suffix(".csv")
    if table.resolve() in [(run / CURVE).resolve() for run in runs]:
        raise ConfigError(f"The table beside {out} would replace the run's own {CURVE}; choose another --out.")
    if len(runs) > len(COLOURS):
        raise ConfigError(f"One picture shows {len(COLOURS)} runs at most, not {len(runs)}; draw two.")
    curves = {run.resolve().name: read_curve(run) for run in runs}
    if len(curves) < len(runs):
        raise ConfigError("The picture names the runs by their folders; give them different names.")
    figure = blank_figure(SIZE[0] * len(PANELS), SIZE[1] + 24 * ((len(curves) + 3) // 4))
    plots = figure.subplots(1, len(PANELS))
    for axes, (column, title, maximum) in zip(plots, PANELS, strict=True):
        axes.set(ylim=(0.0, maximum), xlabel="steps [millions]")
        axes.set_title(title, fontsize=10)
        axes.grid(color="#dddddd")
        for curve, colour in zip(curves.values(), COLOURS, strict=False):
            values = np.convolve(curve[column], np.full(SMOOTH, 1.0 / SMOOTH), mode="valid")
            axes.plot(1e-6 * curve["steps"][-len(values) :], values, color=colour)
    figure.legend(plots[0].get_lines(), list(curves), loc="outside lower left", ncols=4, frameon=False)
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out)
    with table.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("run", *KEPT))
        for name, curve in curves.items():
            rows = zip(*(curve[column][::THIN] for column in KEPT), strict=True)
            writer.writerows((name, *(f"{value:.5g}" for value in row)) for row in rows)
