"""The standard tables of a run, for terminal, report and documents alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from golem.evaluation.base import Case
from golem.evaluation.metrics.statistics import Distribution, Interval
from golem.evaluation.metrics.summary import MethodSummary, PairedMean, Summary
from golem.evaluation.metrics.text_table import TextTable, short_names


@dataclass(frozen=True, slots=True)
class Metric:
    """How one scalar is shown.

    Attributes:
        label: its name in words.
        unit: the unit it is shown in.
        scale: that unit per SI unit.
    """

    label: str
    unit: str = ""
    scale: float = 1.0


_DEG = math.degrees(1.0)

METRICS: dict[str, Metric] = {
    "detect_to_grasp": Metric("first look to closed grasp", "s"),
    "recovery": Metric("first to last negative CoM margin", "s"),
    "walk": Metric("walk to the goal", "s"),
    "total": Metric("whole task", "s"),
    "grasp_aim": Metric("horizontal distance, commanded hand to screw", "mm", 1e3),
    "grasp_reach": Metric("horizontal distance, hand to where it was sent", "mm", 1e3),
    "grasp_miss": Metric("horizontal distance, hand to screw", "mm", 1e3),
    "grasp_depth": Metric("fingertips below the screw's head", "mm", 1e3),
    "grasp_tilt": Metric("approach off vertical", "deg", _DEG),
    "pull_beside": Metric("hand beside the straight line while pulling, at most", "mm", 1e3),
    "pull_turn": Metric("hand turned while pulling, at most", "deg", _DEG),
    "handle_miss": Metric("distance across the approach, hand to handle", "mm", 1e3),
    "handle_reach": Metric("distance, hand to where it was sent", "mm", 1e3),
    "door_angle": Metric("door open at the end", "deg", _DEG),
    "door_angle_error": Metric("door angle as the skill has it, less the true one", "deg", _DEG),
    "set_down_error": Metric("thing set down off its place", "mm", 1e3),
    "others_moved": Metric("another thing moved, at most", "mm", 1e3),
    "places_looked": Metric("remembered places that were gone to"),
    "was_lifted": Metric("thing was lifted"),
    "peak_force": Metric("peak force", "N"),
    "peak_lean": Metric("peak lean (pitch)", "deg", _DEG),
    "peak_tilt": Metric("peak tilt (any direction)", "deg", _DEG),
    "margin_before": Metric("CoM margin before the push", "mm", 1e3),
    "margin_min": Metric("minimum CoM margin", "mm", 1e3),
    "margin_median": Metric("median CoM margin", "mm", 1e3),
    "margin_final": Metric("final CoM margin", "mm", 1e3),
    "below_zero": Metric("time with a negative margin", "s"),
    "steps": Metric("steps taken"),
    "displacement": Metric("base displaced", "mm", 1e3),
    "sway": Metric("base sway, radial RMS", "mm", 1e3),
    "goal_x": Metric("error at the goal along the line", "mm", 1e3),
    "goal_y": Metric("error at the goal across the line", "mm", 1e3),
    "goal_radial": Metric("error at the goal, radial", "mm", 1e3),
    "odometry_error": Metric("odometry off the true pose", "mm", 1e3),
    "place_error": Metric("off where it believes to be, by map and odometry", "mm", 1e3),
    "place_yaw": Metric("off the heading that it believes to have", "deg", _DEG),
    "follower_error": Metric("off the goal by the robot's own belief", "mm", 1e3),
    "stop_shift": Metric("moved by the last stop", "mm", 1e3),
    "contacts": Metric("links that touched something"),
    "before_radial": Metric("beside the nominal stance before docking or picking, radial", "mm", 1e3),
    "before_yaw": Metric("the same, heading", "deg", _DEG),
    "after_radial": Metric("beside the nominal stance at the end, radial", "mm", 1e3),
    "after_yaw": Metric("the same, heading", "deg", _DEG),
    "before_x": Metric("the same, ahead", "mm", 1e3),
    "before_y": Metric("the same, to the left", "mm", 1e3),
    "after_x": Metric("at the end, ahead", "mm", 1e3),
    "after_y": Metric("at the end, to the left", "mm", 1e3),
    "dockings": Metric("dockings"),
    "approaches": Metric("approaches of all dockings"),
    "screws_served": Metric("loose screws within reach at the end"),
    "recoveries": Metric("recoveries"),
    "stood": Metric("stood on its way", "s"),
    "nobody": Metric("walkers that are nobody, of all at all steps", "%", 100.0),
    "goal_yaw": Metric("heading error at the goal", "deg", _DEG),
    "base_range": Metric("largest distance between two places of the base", "mm", 1e3),
    "share_not_negative": Metric("share of time with the CoM margin not negative", "%", 100.0),
    "speed_before": Metric("forward speed before the push", "m/s"),
    "error_vx": Metric("error of the mean forward speed", "m/s"),
    "error_vy": Metric("error of the mean leftward speed", "m/s"),
    "error_speed": Metric("error of the mean velocity", "m/s"),
    "error_wz": Metric("error of the mean yaw rate", "rad/s"),
    "seconds": Metric("time survived", "s"),
    "pushes": Metric("pushes met"),
    "distance": Metric("way gone", "m"),
    "climbed": Metric("height gained", "m"),
    "velocity_standing": Metric("velocity error standing, RMS", "m/s"),
    "velocity_walking": Metric("velocity error walking, RMS", "m/s"),
    "drift": Metric("position error at the end per way gone", "m/m"),
    "yaw_drift": Metric("error of the heading's change", "deg", _DEG),
    "gap": Metric("longest time without a believed foot", "ms", 1e3),
    "tick": Metric("CPU time of a tick, median", "us", 1e6),
    "tick_p99": Metric("CPU time of a tick, 99 % quantile", "us", 1e6),
    "ate": Metric("trajectory off the true one, RMS after alignment", "cm", 1e2),
    "end_error": Metric("place on the floor off at the end", "cm", 1e2),
    "end_height": Metric("height off at the end", "cm", 1e2),
    "end_range": Metric("end too far from the beginning", "cm", 1e2),
    "end_bearing": Metric("direction from beginning to end off", "deg", _DEG),
    "end_heading": Metric("heading off at the end", "deg", _DEG),
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
    "drop_inside": Metric("hand inside the tray's rim when it lets go", "mm", 1e3),
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
    return METRICS.get(name, Metric(name.replace("_", " ")))


SECONDS = Metric("", "s")
MINUS = "\N{MINUS SIGN}"


def run_tables(summary: Summary) -> list[TextTable]:
    """Return the tables that say all of a summary: rates, comparisons, metrics, and their paired differences."""
    tables = [rates(summary), comparisons(summary), metrics(summary), metric_differences(summary)]
    return [table for table in tables if table is not None]


def rates(summary: Summary) -> TextTable:
    """Return success rates with intervals, times, and where the rest was lost."""
    times = list(dict.fromkeys(name for row in summary.rows for name in row.times))
    columns = [
        "success",
        "rate",
        "95 % interval",
        *(f"{name.replace('_', ' ')} [s]" for name in times),
        "lost in",
    ]
    short = short_names(summary.methods)
    rows = [
        (
            *_head(row, short),
            f"{row.successes}/{row.n}",
            f"{percent(row.rate)} %",
            _interval(row.interval, 100.0),
            *(_median(row.times.get(name), SECONDS) for name in times),
            ", ".join(f"{stage} {count}" for stage, count in row.stages.items()) or "-",
        )
        for row in summary.rows
    ]
    note = "Wilson intervals" + ("; times: median and quartiles, robot time." if times else ".")
    return TextTable("", (*_names(summary), *columns), tuple(rows), note)


def comparisons(summary: Summary) -> TextTable | None:
    """Return the paired tests of success; None where nothing is compared."""
    if not summary.comparisons:
        return None
    columns = (
        "both",
        "only first",
        "only second",
        "neither",
        "difference [points]",
        "McNemar p",
        "Holm-adjusted p",
    )
    short = short_names(summary.methods)
    rows = [
        (
            f"{short[c.a]} against {short[c.b]}",
            *_values(c.case),
            *(str(n) for n in (c.table.both, c.table.only_a, c.table.only_b, c.table.neither)),
            f"{100 * (c.table.only_a - c.table.only_b) / c.table.n:+.1f} {_interval(c.difference, 100.0, '+')}",
            p_value(c.p),
            p_value(c.p_holm),
        )
        for c in summary.comparisons
    ]
    return TextTable("Paired comparison of success", ("pair", *_names(summary)[1:], *columns), tuple(rows))


def metrics(summary: Summary) -> TextTable | None:
    """Return what was measured: median and mean with intervals, extremes; None where nothing was."""
    columns = (
        "n",
        "median",
        "95 % interval",
        "mean",
        "95 % interval",
        "rms",
        "95th percentile of size",
        "min",
        "max",
    )
    short = short_names(summary.methods)
    rows = [
        (_label(name), *_head(row, short), *_figures(d, metric(name)))
        for name in _measured([{**row.metrics, **row.costs} for row in summary.rows])
        for row in summary.rows
        if (d := {**row.metrics, **row.costs}.get(name)) is not None
    ]
    if not rows:
        return None
    return TextTable(
        "What was measured",
        ("metric", *_names(summary), *columns),
        tuple(rows),
        "Over the trials that got that far. Intervals: median, between two values; mean, Student's t.",
    )


def metric_differences(summary: Summary) -> TextTable | None:
    """Return the paired differences of what was measured; None where nothing is compared."""
    short = short_names(summary.methods)
    # Where both met the same, as the draws of a scene, there is no difference to tell.
    rows = [
        (
            _label(name),
            f"{short[c.a]} {MINUS} {short[c.b]}",
            *_values(c.case),
            *_difference(c.metrics[name], metric(name)),
        )
        for name in _measured([c.metrics for c in summary.comparisons])
        for c in summary.comparisons
        if name in c.metrics and c.metrics[name].interval != Interval(0.0, 0.0)
    ]
    if not rows:
        return None
    columns = ("metric", "pair", *_names(summary)[1:], "n", "mean difference", "95 % interval")
    return TextTable("Paired differences", columns, tuple(rows), "Student's t over the pairs.")


def percent(value: float) -> str:
    """Return a rate, 0 to 1, in percent."""
    return f"{100 * value:.1f}"


def p_value(value: float) -> str:
    """Return a p-value as it is quoted."""
    return "< 0.0001" if value < 1e-4 else f"{value:.2g}"


def _names(summary: Summary) -> tuple[str, ...]:
    return ("method", *(summary.rows[0].case if summary.rows else ()))


def _head(row: MethodSummary, short: Mapping[str, str]) -> tuple[str, ...]:
    return (short[row.method], *_values(row.case))


def _values(case: Case) -> tuple[str, ...]:
    return tuple(value if isinstance(value, str) else f"{value:g}" for value in case.values())


def _measured(rows: Sequence[dict[str, Distribution]] | Sequence[dict[str, PairedMean]]) -> list[str]:
    """Return the names of what was measured, declared metrics first and in their order."""
    names = dict.fromkeys(name for row in rows for name in row)
    return [*(name for name in METRICS if name in names), *(name for name in names if name not in METRICS)]


def _label(name: str) -> str:
    m = metric(name)
    return f"{m.label} [{m.unit}]" if m.unit else m.label


def _figures(d: Distribution, m: Metric) -> tuple[str, ...]:
    return (
        str(d.n),
        number(d.median, m),
        _interval(d.median_interval, m.scale),
        number(d.mean, m),
        _interval(d.mean_interval, m.scale),
        *(number(x, m) for x in (d.rms, d.p95_size, d.minimum, d.maximum)),
    )


def _difference(d: PairedMean, m: Metric) -> tuple[str, ...]:
    return str(d.n), f"{m.scale * d.mean:+.3g}", _interval(d.interval, m.scale, "+")


def number(value: float, m: Metric) -> str:
    """Return a value in the unit it is shown in, with three digits."""
    return f"{m.scale * value:.3g}"


def _median(d: Distribution | None, m: Metric) -> str:
    if d is None:
        return "-"
    return f"{number(d.median, m)} ({number(d.q1, m)} to {number(d.q3, m)}{f', n = {d.n}'})"


def _interval(interval: Interval | None, scale: float, sign: str = "") -> str:
    if interval is None:
        return "-"
    return f"[{scale * interval.low:{sign}.3g}, {scale * interval.high:{sign}.3g}]"
