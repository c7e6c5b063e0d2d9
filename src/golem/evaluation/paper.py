"""The published results that a rung's report sets beside its own."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """One entry of the GOLEM paper's table of grasp success.

    Attributes:
        label: task and environment, e.g. `"screw, real robot"`.
        successes, n: trials.
        time: published time in words, where there is one.
    """

    label: str
    successes: int
    n: int = 30
    time: str = ""


PAPER: dict[tuple[str, str], tuple[PaperFigure, ...]] = {
    ("tether", "centroid"): (PaperFigure("screw, simulation", 30), PaperFigure("screw, real robot", 0)),
    ("tether", "visual_servo"): (
        PaperFigure("screw, simulation", 30),
        PaperFigure("screw, real robot", 29, time="75 ± 16 s from detection to grasp"),
    ),
}
"""(rung, method) -> published figures."""
