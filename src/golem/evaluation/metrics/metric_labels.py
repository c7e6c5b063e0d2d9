"""What people call the series of a trial record, and the units they read them in; the records are in SI units."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Measure:
    """How one series is shown.

    Attributes:
        label: its name in words.
        unit: the unit it is shown in.
        scale: that unit per SI unit.
    """

    label: str
    unit: str = ""
    scale: float = 1.0


_DEG = math.degrees(1.0)

MEASURES: dict[str, Measure] = {
    "grasp_aim": Measure("hand sent beside the screw", "mm", 1e3),
    "grasp_reach": Measure("hand beside where it was sent", "mm", 1e3),
    "grasp_miss": Measure("hand beside the screw", "mm", 1e3),
    "grasp_depth": Measure("fingertips below the screw's head", "mm", 1e3),
    "grasp_tilt": Measure("approach off vertical", "deg", _DEG),
    "peak_force": Measure("peak force", "N"),
    "peak_lean": Measure("peak lean (pitch)", "deg", _DEG),
    "peak_tilt": Measure("peak tilt (any direction)", "deg", _DEG),
    "margin_before": Measure("CoM margin before the push", "mm", 1e3),
    "margin_min": Measure("least CoM margin", "mm", 1e3),
    "margin_median": Measure("median CoM margin", "mm", 1e3),
    "margin_final": Measure("final CoM margin", "mm", 1e3),
    "below_zero": Measure("time with a negative margin", "s"),
    "steps": Measure("steps taken"),
    "displacement": Measure("base displaced", "mm", 1e3),
    "sway": Measure("base sway, radial RMS", "mm", 1e3),
    "goal_x": Measure("error at the goal along the line", "mm", 1e3),
    "goal_y": Measure("error at the goal across the line", "mm", 1e3),
    "goal_radial": Measure("error at the goal, radial", "mm", 1e3),
    "odometry_error": Measure("odometry off the true pose", "mm", 1e3),
    "goal_yaw": Measure("heading error at the goal", "deg", _DEG),
}
"""Series name -> how it is shown; a series that is not here is shown as it is."""
