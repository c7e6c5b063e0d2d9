"""Rung `gate-limits`: which limit of the safety gate ends a lower body that would have recovered from a push."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from golem.errors import unknown_name
from golem.evaluation.base import Case, Outcomes, Results, TrialOutcome, TrialSpec
from golem.evaluation.metrics.statistics import Interval, clustered
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.rungs.pushed_rung import PushedOptions, PushedRung, gait_name
from golem.hardware.safety.base import SafetyLimits
from golem.stack import Stack
from golem.types import NUM_JOINTS

Lift = Callable[[SafetyLimits], SafetyLimits]
"""Returns limits of which some are lifted."""
NOTHING = "nothing"
"""The gate as it ships."""
FAR = np.full(NUM_JOINTS, 1e3)
"""Beyond every position [rad], speed [rad/s] and torque [N m] of a robot."""
STOPS: dict[str, Lift] = {
    "speed": lambda limits: replace(limits, velocity=FAR),
    "range": lambda limits: replace(limits, state_lower=-FAR, state_upper=FAR),
    "torque": lambda limits: replace(limits, torque_samples=10**9),
    "tilt": lambda limits: replace(limits, tilt=math.pi),
    "balance": lambda limits: replace(limits, capture=math.inf, sinking=math.inf, lean=math.inf, low=-math.inf),
    "sender": lambda limits: replace(
        limits,
        sane=np.full_like(limits.sane, 1e6),
        jolts=math.inf,
        throw=(1e6, 1e6, 1e6),
        hung=math.inf,
        least_kp=np.full(NUM_JOINTS, 1e-9),
        least_kd=np.zeros(NUM_JOINTS),
    ),
}
"""What stops the robot: measured quantities, of which `range` is position and braking distance, and `sender`, commands
that are far beyond the robot, jump, hang, or hold too little. No stiffness at all stays less than the least: targets of
such motors mean nothing."""
BOUNDS: dict[str, Lift] = {
    "position": lambda limits: replace(limits, lower=-FAR, upper=FAR),
    "slew": lambda limits: replace(limits, slew=FAR),
    "effort": lambda limits: replace(limits, torque_command=FAR),
    "gains": lambda limits: replace(limits, kp_max=1e3, kd_max=1e3, kp_rate=1e6, kd_rate=1e6),
}
"""Bounds to which commands are clipped; `effort` is the predicted torque of a command."""
GROUPS = {NOTHING: (), "stops": tuple(STOPS), "bounds": tuple(BOUNDS)}
"""Names for several of them."""


def lifted(limits: SafetyLimits, names: str) -> SafetyLimits:
    """Return `limits` without those of `names`, e.g. `stops+slew`. Raises ConfigError: there is no such limit."""
    single = STOPS | BOUNDS
    for name in names.split("+"):
        if name not in GROUPS and name not in single:
            raise unknown_name("limit", name, (*GROUPS, *single))
        for each in GROUPS.get(name, (name,)):
            limits = single[each](limits)
    return limits


@dataclass(frozen=True)
class GateLimitsOptions(PushedOptions):
    """The pushes, and which limits are lifted."""

    direction: tuple[str, ...] = ("front", "left", "back", "right")
    """Where the push drives the robot."""
    level: tuple[float, ...] = (30.0, 60.0)
    """Sizes of the push."""
    lift: tuple[str, ...] = (NOTHING, "stops", "bounds", *(f"stops+{name}" for name in (*BOUNDS, "bounds")))
    """What is lifted: speed, range, torque, tilt, balance, sender (stops), position, slew, effort, gains (bounds), with
    a + between."""


class GateLimits(PushedRung[GateLimitsOptions]):
    """Survive pushes with one limit of the safety gate after another lifted: which of them cost the recovery?"""

    name = "gate-limits"
    Options = GateLimitsOptions
    adaptive = True

    def __init__(self, options: GateLimitsOptions | None = None) -> None:
        super().__init__(options)
        self._each("level", "lift")
        for names in self.options.lift:
            lifted(SafetyLimits.from_profile(), names)

    def cases(self, results: Results) -> Sequence[Case]:
        o = self.options
        return [
            {"lift": lift, "phase": phase, "walk": walk, "direction": direction, "level": level}
            for lift in o.lift
            for phase, walk in self.gaits
            for direction in o.direction
            for level in o.level
        ]

    def together(self, spec: TrialSpec) -> Hashable:
        return spec.method, spec.index, spec.case["lift"], spec.case["phase"], spec.case["walk"]

    def limits(self, spec: TrialSpec, stack: Stack) -> SafetyLimits:
        return lifted(SafetyLimits.from_profile(stack.limits), str(spec.case["lift"]))

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        rows, short = list[tuple[str, ...]](), short_names(outcomes)
        for method, trials in outcomes.items():
            for gait in self.gaits:
                for level in self.options.level:
                    for lift in self.options.lift:
                        want = {"lift": lift, "phase": gait[0], "walk": gait[1], "level": level}
                        mine, robots = list[TrialOutcome](), dict[int, list[bool]]()
                        for spec, outcome in trials:
                            if want.items() <= spec.case.items():
                                mine.append(outcome)
                                robots.setdefault(spec.index, []).append(outcome.success)
                        won = sum(outcome.success for outcome in mine)
                        interval = clustered(list(robots.values())) if mine else Interval(0.0, 1.0)
                        rows.append(
                            (
                                short[method],
                                gait_name(gait),
                                f"{level:g}",
                                lift,
                                f"{won} of {len(mine)} {interval.text(100.0)}",
                                _ends(mine),
                            )
                        )
        return (
            TextTable(
                "Pushes survived where a limit of the gate is lifted, all directions together",
                ("lower body", "phase", "push", "lifted", "survived [%]", "the others ended by"),
                tuple(rows),
                "A fall is judged on the simulator's truth; everything else is a stop of the gate. One robot is "
                "pushed in all directions from one past: the interval counts robots, not pushes.",
            ),
        )


def _ends(outcomes: Sequence[TrialOutcome]) -> str:
    """Return what ended the trials that were lost, the most frequent first."""
    ends = Counter(_end(outcome) for outcome in outcomes if not outcome.success)
    return ", ".join(f"{end} {count}" for end, count in ends.most_common())


def _end(outcome: TrialOutcome) -> str:
    """Return the reason of a safety stop with its joint and without side and figures, or the stage."""
    if outcome.stage != "safety":
        return outcome.stage
    reason = outcome.detail.partition(": ")[2]
    words = reason.replace(":", "").split()
    return " ".join(words[:2]).replace("left_", "").replace("right_", "")
