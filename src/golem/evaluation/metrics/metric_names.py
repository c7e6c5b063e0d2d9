"""What a trial may measure, and how it is called and shown."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Metric:
    """How one scalar is shown.

    Attributes:
        label: its name in words.
        unit: the unit it is shown in.
        scale: that unit per SI unit.
        signed: whether it may be negative.
    """

    label: str
    unit: str = ""
    scale: float = 1.0
    signed: bool = False

    @property
    def share(self) -> bool:
        """Whether it is a share of what was asked, 0 to 1, in one trial."""
        return self.unit == "%"

    @property
    def bounds(self) -> tuple[float, float]:
        """Between what its values must lie, in SI units."""
        return (0.0, 1.0) if self.share else (-math.inf if self.signed else 0.0, math.inf)


_DEG = math.degrees(1.0)

METRICS: dict[str, Metric] = {
    "detect_to_grasp": Metric("first look to closed grasp", "s"),
    "recovery": Metric("first to last negative CoM margin", "s"),
    "walk": Metric("walk to the goal", "s"),
    "total": Metric("whole task", "s"),
    "grasp_aim": Metric("horizontal distance, commanded hand to screw", "mm", 1e3),
    "grasp_reach": Metric("horizontal distance, hand to where it was sent", "mm", 1e3),
    "grasp_miss": Metric("horizontal distance, hand to screw", "mm", 1e3),
    "grasp_depth": Metric("fingertips below the screw's head", "mm", 1e3, signed=True),
    "grasp_tilt": Metric("approach off vertical", "deg", _DEG),
    "pull_beside": Metric("hand beside the straight line while pulling, at most", "mm", 1e3),
    "pull_turn": Metric("hand turned while pulling, at most", "deg", _DEG),
    "handle_miss": Metric("distance across the approach, hand to handle", "mm", 1e3),
    "handle_reach": Metric("distance, hand to where it was sent", "mm", 1e3),
    "door_angle": Metric("door open at the end", "deg", _DEG, signed=True),
    "door_angle_error": Metric("door angle as the skill has it, less the true one", "deg", _DEG, signed=True),
    "set_down_error": Metric("thing set down off its place", "mm", 1e3),
    "others_moved": Metric("another thing moved, at most", "mm", 1e3),
    "places_looked": Metric("remembered places that were gone to"),
    "was_lifted": Metric("thing was lifted", "%", 100.0),
    "peak_force": Metric("peak force", "N"),
    "peak_lean": Metric("peak lean (pitch)", "deg", _DEG),
    "peak_tilt": Metric("peak tilt (any direction)", "deg", _DEG),
    "margin_before": Metric("CoM margin before the push", "mm", 1e3, signed=True),
    "margin_min": Metric("minimum CoM margin", "mm", 1e3, signed=True),
    "margin_median": Metric("median CoM margin", "mm", 1e3, signed=True),
    "margin_final": Metric("final CoM margin", "mm", 1e3, signed=True),
    "below_zero": Metric("time with a negative margin", "s"),
    "steps": Metric("steps taken"),
    "displacement": Metric("base displaced", "mm", 1e3),
    "sway": Metric("base sway, radial RMS", "mm", 1e3),
    "goal_x": Metric("error at the goal along the line", "mm", 1e3, signed=True),
    "goal_y": Metric("error at the goal across the line", "mm", 1e3, signed=True),
    "goal_radial": Metric("error at the goal, radial", "mm", 1e3),
    "odometry_error": Metric("odometry off the true pose", "mm", 1e3),
    "place_error": Metric("off where it believes to be, by map and odometry", "mm", 1e3),
    "place_yaw": Metric("off the heading that it believes to have", "deg", _DEG, signed=True),
    "follower_error": Metric("off the goal by the robot's own belief", "mm", 1e3, signed=True),
    "stop_shift": Metric("moved by the last stop", "mm", 1e3),
    "contacts": Metric("links that touched something"),
    "before_radial": Metric("beside the nominal stance before docking or picking, radial", "mm", 1e3),
    "before_yaw": Metric("the same, heading", "deg", _DEG, signed=True),
    "after_radial": Metric("beside the nominal stance at the end, radial", "mm", 1e3),
    "after_yaw": Metric("the same, heading", "deg", _DEG, signed=True),
    "before_x": Metric("the same, ahead", "mm", 1e3, signed=True),
    "before_y": Metric("the same, to the left", "mm", 1e3, signed=True),
    "after_x": Metric("at the end, ahead", "mm", 1e3, signed=True),
    "after_y": Metric("at the end, to the left", "mm", 1e3, signed=True),
    "dockings": Metric("dockings"),
    "approaches": Metric("approaches of all dockings"),
    "screws_served": Metric("loose screws within reach at the end"),
    "loosened": Metric("loosened fasteners"),
    "loosened_in_tray": Metric("of the loosened fasteners in their tray", "%", 100.0),
    "wrong_in_tray": Metric("fasteners wrongly said to be in the tray"),
    "wrong_refusals": Metric("loosened fasteners, rightly claimed, in no tray"),
    "false_claims_found": Metric("of those wrongly claimed loose, said to be tight", "%", 100.0),
    "planned": Metric("way of the first plan", "m"),
    "recoveries": Metric("recoveries"),
    "stood": Metric("stood on its way", "s"),
    "nobody": Metric("walkers that are nobody, of all at all steps", "%", 100.0),
    "goal_yaw": Metric("heading error at the goal", "deg", _DEG, signed=True),
    "base_range": Metric("largest distance between two places of the base", "mm", 1e3),
    "height_error": Metric("largest error of the base's height", "mm", 1e3),
    "share_not_negative": Metric("share of time with the CoM margin not negative", "%", 100.0),
    "speed_before": Metric("forward speed before the push", "m/s"),
    "error_vx": Metric("error of the mean forward speed", "m/s", signed=True),
    "error_vy": Metric("error of the mean leftward speed", "m/s", signed=True),
    "error_speed": Metric("error of the mean velocity", "m/s"),
    "error_wz": Metric("error of the mean yaw rate", "rad/s", signed=True),
    "seconds": Metric("time survived", "s"),
    "pushes": Metric("pushes met"),
    "lived": Metric("waypoints of which it saw the end", "%", 100.0),
    "reached": Metric("waypoints reached", "%", 100.0),
    "goal_turn": Metric("heading error at the goal, size", "deg", _DEG),
    "work": Metric("work of the legs, both signs positive", "kJ", 1e-3),
    "transport": Metric("the same by weight and way"),
    "pace": Metric("robot seconds per CPU second"),
    "distance": Metric("way gone", "m", signed=True),
    "climbed": Metric("height gained", "m", signed=True),
    "velocity_standing": Metric("velocity error standing, RMS", "m/s"),
    "velocity_walking": Metric("velocity error walking, RMS", "m/s"),
    "drift": Metric("position error at the end per way gone", "m/m"),
    "yaw_drift": Metric("error of the heading's change", "deg", _DEG, signed=True),
    "gap": Metric("longest time without a believed foot", "ms", 1e3),
    "tick": Metric("CPU time of a tick, median", "us", 1e6),
    "tick_p99": Metric("CPU time of a tick, 99 % quantile", "us", 1e6),
    "ate": Metric("trajectory off the true one, RMS after alignment", "cm", 1e2),
    "end_error": Metric("place on the floor off at the end", "cm", 1e2),
    "end_height": Metric("height off at the end", "cm", 1e2, signed=True),
    "end_range": Metric("end too far from the beginning", "cm", 1e2, signed=True),
    "end_bearing": Metric("direction from beginning to end off", "deg", _DEG, signed=True),
    "end_heading": Metric("heading off at the end", "deg", _DEG, signed=True),
    "frames_lost": Metric("scans after which it was silent"),
    "nees_place": Metric("squared error of the place over its covariance"),
    "nees_heading": Metric("the same of the heading"),
    "frame": Metric("CPU time of a scan with all between two, median", "ms", 1e3),
    "frame_p99": Metric("CPU time of a scan with all between two, 99 % quantile", "ms", 1e3),
    "static_mrr": Metric("mean reciprocal rank before anything moved", "%", 100.0),
    "current_top1": Metric("first answer is where it is now", "%", 100.0),
    "outdated_top1": Metric("first answer is where it was", "%", 100.0),
    "unmoved_top1": Metric("first answer is where what did not move is", "%", 100.0),
    "history_at3": Metric("old place among the first three", "%", 100.0),
    "absent": Metric("nothing answered of what is not there", "%", 100.0),
    "query": Metric("CPU time of a question, median", "us", 1e6),
    "update": Metric("CPU time of a look, median", "ms", 1e3),
    "plans_per_second": Metric("plans per second"),
    "in_time": Metric("share of plans in time", "%", 100.0),
    "claim_picked": Metric("right when it says a screw is in the tray", "%", 100.0),
    "claim_tight": Metric("right when it says a screw is tight", "%", 100.0),
    "claim_jammed": Metric("right when it says a screw is jammed", "%", 100.0),
    "claim_nothing_there": Metric("right when it says there is no screw", "%", 100.0),
    "claim_out_of_reach": Metric("right when it says a screw is out of reach", "%", 100.0),
    "claim_in_tray": Metric("right about the screw in the tray when it looks afterwards", "%", 100.0),
    "claim_bore_empty": Metric("right about the bore when it looks afterwards", "%", 100.0),
    "drop_inside": Metric("hand inside the tray's rim when it lets go", "mm", 1e3, signed=True),
    "doable": Metric("a hand reaches a loose screw and the tray", "%", 100.0),
    "refusal_right": Metric("right when it says that it cannot be done", "%", 100.0),
    "self_contacts": Metric("pairs of own links that touched"),
    "touches": Metric("links that touched pack or tray away from the screws"),
    "touch_force": Metric("largest force on pack or tray", "N"),
    "claim_tray_full": Metric("right when it says the tray is full", "%", 100.0),
    "claim_tray_out_of_reach": Metric("right when it says the tray is out of reach", "%", 100.0),
    "claim_tray_missing": Metric("right when it says there is no tray", "%", 100.0),
    "cpu_per_plan": Metric("CPU time of a plan", "ms", 1e3),
}
"""Name -> how it is shown."""


def metric(name: str) -> Metric:
    """Return how the scalar `name` is shown; one that is not declared, as it is."""
    words = name.replace("_", " ")
    claim = Metric(words, "%", 100.0) if name.startswith("said_") else Metric(words, signed=True)
    return METRICS.get(name, claim)
