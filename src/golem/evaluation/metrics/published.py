"""The published results that a rung's report compares with its own."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class PaperFigure:
    """One success rate of the GOLEM paper.

    Attributes:
        label: task and environment, e.g. `"screw, real robot"`.
        successes, n: trials.
        time: published time in words, where there is one.
    """

    label: str
    successes: int
    n: int = 30
    time: str = ""


GGX_F = "{use: reranked, proposer: {use: graspgen}}"
"""The method that the paper calls GGX-F."""

PAPER: dict[tuple[str, str], tuple[PaperFigure, ...]] = {
    ("tether", "centroid"): (PaperFigure("screw, simulation", 30), PaperFigure("screw, real robot", 0)),
    ("tether", "visual_servo"): (
        PaperFigure("screw, simulation", 30),
        PaperFigure("screw, real robot", 29, time="75 ± 16 s from detection to grasp"),
    ),
    ("stand", "centroid"): (PaperFigure("screw, simulation", 27), PaperFigure("screw, real robot", 0)),
    ("stand", "visual_servo"): (PaperFigure("screw, simulation", 30), PaperFigure("screw, real robot", 26)),
    ("tether", "graspgen"): (PaperFigure("screw, simulation", 0),),
    ("tether", GGX_F): (PaperFigure("screw, simulation", 0),),
    ("stand", "graspgen"): (PaperFigure("screw, simulation", 0),),
    ("stand", GGX_F): (PaperFigure("screw, simulation", 0),),
    ("var-stand", "centroid"): (PaperFigure("screw, real robot", 0),),
    ("var-stand", "visual_servo"): (PaperFigure("screw, real robot", 11),),
    # Its fridges are RoboCasa's, ours is our own; of GraspGenX there are no weights here.
    ("fridge-tether", "centroid"): (PaperFigure("fridge, RoboCasa", 30),),
    ("fridge-tether", "antipodal"): (PaperFigure("fridge, RoboCasa", 19),),
    ("fridge-tether", "graspgen"): (PaperFigure("fridge, RoboCasa", 16),),
    ("fridge-tether", GGX_F): (PaperFigure("fridge, RoboCasa", 29),),
    ("fridge-stand", "centroid"): (PaperFigure("fridge, RoboCasa", 24),),
    ("fridge-stand", "antipodal"): (PaperFigure("fridge, RoboCasa", 8),),
    ("fridge-stand", "graspgen"): (PaperFigure("fridge, RoboCasa", 16),),
    ("fridge-stand", GGX_F): (PaperFigure("fridge, RoboCasa", 21),),
    # Its MPC, of which it gives no count, was stopped by the operator; the vendor's policy did not stand still.
    ("push", "almi"): (PaperFigure("positive margin recovered, real robot", 14, 15),),
    ("push-ramp", "almi"): (PaperFigure("positive margin recovered, real robot", 14, 15),),
    ("navigate-line", "vendor"): (PaperFigure("goal reached, real robot", 19, 20),),
}
"""(rung, method) -> published figures."""
