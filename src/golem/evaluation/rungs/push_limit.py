"""Rungs `push-limit` and `gate-limits`: the largest push that a lower body survives, and what the gate costs of it."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.base import Case, Outcomes, Results, TrialOutcome, TrialSpec
from golem.evaluation.episodes.plain_episode import PlainEpisode, own_legs
from golem.evaluation.harness.arguments import robot_options
from golem.evaluation.metrics.statistics import Interval, clustered, wilson
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.report.svg_figure import method_colour
from golem.evaluation.rungs.leg_rung import BOUNDS, NO_WALKER, NOTHING, lifted
from golem.evaluation.rungs.pushed_rung import Gait, PushedEpisode, PushedOptions, PushedRung, gait_name
from golem.hardware.safety.base import SafetyLimits
from golem.robots.mujoco.shoves import DIRECTIONS

Terms = Literal["stack", "unstopped", "ungated", "own"]
LIFTED: dict[str, str] = {"stack": NOTHING, "unstopped": "stops", "ungated": "stops+bounds"}
"""What is lifted of the gate on each of the stack's terms; see `lifted`."""
Trial = tuple[TrialSpec, TrialOutcome]
SURVIVED = 0.95
"""Share of the trials of a level that has to be survived."""


@dataclass(frozen=True)
class PushLimitOptions(PushedOptions):
    """The search. Levels ascend until one is lost; where the first level is lost they descend instead."""

    terms: tuple[Terms, ...] = ("stack",)
    """stack: with gate, estimator, latency and working arms. unstopped: its gate clips commands, but never stops the
    robot. ungated: it does neither. own: the robot alone in plain MuJoCo, the true state."""
    first: float = 10.0
    """First level."""
    step: float = 10.0
    """Distance between levels."""
    last: float = 200.0
    """Highest level."""


class PushLimit(PushedRung[PushLimitOptions]):
    """Survive ever larger pushes: the largest that 19 of 20 robots survive, by direction and moment."""

    name = "push-limit"
    Options = PushLimitOptions
    adaptive = True

    def __init__(self, options: PushLimitOptions | None = None) -> None:
        super().__init__(options)
        o = self.options
        for option, value in (("first", o.first), ("step", o.step)):
            if value <= 0.0:
                raise ConfigError(f"--{option} is {value:g}; it must be more than 0.")
        if o.last < o.first:
            raise ConfigError(f"--last is {o.last:g}; it must be at least --first, {o.first:g}.")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        if "own" in self.options.terms:
            own_legs(method)
        return super().config(method, profile, overrides)

    def cases(self, results: Results) -> Sequence[Case]:
        return [
            case
            for terms in self.options.terms
            for gait in self.gaits
            for direction in self.options.direction
            for case in self._levels(results, terms, gait, direction)
        ]

    def _levels(self, results: Results, terms: str, gait: Gait, direction: str) -> Iterator[Case]:
        level: float | None = self.options.first
        while level is not None:
            case: Case = {"terms": terms, "phase": gait[0], "walk": gait[1], "direction": direction, "level": level}
            yield case
            found = results(case)
            if found is None:
                return
            level = self.next([None if o.success else o.stage for o in found], level)

    def next(self, losses: Sequence[str | None], level: float) -> float | None:
        """Return the level to try after `level` in one direction: up as long as they pass, down if the first fails.

        Args:
            losses: the stage in which each robot was lost at this level; None where it survived.
            level: present one.
        """
        o, passed = self.options, survived(losses)
        if level < o.first:
            following = None if passed else level - o.step
        elif passed:
            following = level + o.step
        else:
            following = o.first - o.step if level == o.first and NO_WALKER not in losses else None
        return following if following is not None and 1e-9 < following <= o.last + 1e-9 else None

    def lifts(self, spec: TrialSpec) -> str:
        return LIFTED[str(spec.case["terms"])]

    def robot(self, spec: TrialSpec) -> PushedEpisode:
        if spec.case["terms"] != "own":
            return super().robot(spec)
        path = robot_options(self.options.robot).get("mjcf")
        plain = PlainEpisode(spec.method, None if path is None else Path(path), spec.rng("start"))
        if self.options.height is not None:
            plain.lower(self.options.height)
        return plain

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        o, unit = self.options, "N s" if self.options.kind == "shove" else "N"
        what = "shove of 0.2 s on the torso [N s]" if o.kind == "shove" else "half-sine push of 1 s at the pelvis [N]"
        n = len({spec.index for trials in outcomes.values() for spec, _ in trials})
        rows, costs, short = list[tuple[str, ...]](), list[tuple[str, ...]](), short_names(outcomes)
        for method, trials in outcomes.items():
            for gait in self.gaits:
                means = dict[str, float]()
                for terms in o.terms:
                    cells = [limit(_of(trials, terms, gait, d)) for d in o.direction]
                    lowest = min(cells, key=lambda cell: cell[0])[1]
                    texts = (text for _, text in cells)
                    rows.append((short[method], terms, gait_name(gait), *texts, lowest))
                    means[terms] = float(np.mean([level for level, _ in cells]))
                costs.append((short[method], gait_name(gait), *shares(means)))
        directions = (d.replace("_", " ") for d in o.direction)
        found = TextTable(
            f"Largest {what} that {n - allowed(n)} of {n} robots survived",
            ("lower body", "terms", "phase", *directions, "min"),
            tuple(rows),
            f"A level is lost with {allowed(n) + 1} of {n} robots, so one that is held may be survived by as few as "
            f"{100 * wilson(n - allowed(n), n).low:.0f} % (Wilson); >=: the highest one tried was not lost.",
        )
        if len(o.terms) == 1:
            return (found,)
        cost = TextTable(
            f"What the gate and the rest of the stack cost of it, mean of {len(o.direction)} directions [{unit}]",
            ("lower body", "phase", "the gate stops", "the gate clips", "gate, both", "the rest of the stack"),
            tuple(costs),
            "stops: unstopped - stack; clips: ungated - unstopped; rest (hands, arms, estimator, latency, profile): "
            "own - ungated. Empty where one of the two terms was not asked for.",
        )
        return found, cost

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        """Draw the largest push survived over its direction, ahead at the top; a plot per terms and gait."""
        o = self.options
        cells, short = [(terms, gait) for gait in self.gaits for terms in o.terms], short_names(outcomes)
        rows = len(self.gaits) if len(o.terms) > 1 else 1
        angles = np.radians([45.0 * DIRECTIONS.index(direction) for direction in o.direction])
        shape = rows, len(cells) // rows
        figure.set_figheight(rows * figure.get_figheight())
        plots = figure.subplots(*shape, subplot_kw={"projection": "polar"}, squeeze=False).ravel()
        for axes, (terms, gait) in zip(plots, cells, strict=True):
            for i, (method, trials) in enumerate(outcomes.items()):
                best = [limit(_of(trials, terms, gait, d))[0] for d in o.direction]
                closed = np.append(angles, angles[:1]), [*best, best[0]]
                axes.plot(
                    *closed, "o-", color=method_colour(i), ms=4, label=short[method] if axes is plots[0] else None
                )
                axes.fill(*closed, color=method_colour(i), alpha=0.12)
            axes.set(theta_offset=np.pi / 2, title=f"{gait_name(gait)}, {terms}")
            axes.set_xticks(np.radians(45.0 * np.arange(8)), [d.replace("_", " ") for d in DIRECTIONS])
        figure.legend(loc="outside lower center", ncols=3)
        return f"Largest push survived, by direction [{'N s' if o.kind == 'shove' else 'N'}]"


def _of(trials: Sequence[Trial], terms: str, gait: Gait, direction: str) -> Sequence[Trial]:
    want = {"terms": terms, "phase": gait[0], "walk": gait[1], "direction": direction}
    return [trial for trial in trials if want.items() <= trial[0].case.items()]


def shares(means: Mapping[str, float]) -> tuple[str, ...]:
    """Return what stops, clipping, both, and the rest of the stack cost, by the mean limit on each of the terms."""
    pairs = (("unstopped", "stack"), ("ungated", "unstopped"), ("ungated", "stack"), ("own", "ungated"))
    return tuple(f"{means[a] - means[b]:.0f}" if {a, b} <= means.keys() else "" for a, b in pairs)


def allowed(n: int) -> int:
    """Return how many of `n` trials a level may lose."""
    return math.floor((1.0 - SURVIVED) * n + 1e-9)


def survived(losses: Sequence[str | None]) -> bool:
    """Return whether a level passed, of whose trials `losses` were lost, None where one was not."""
    return sum(loss is not None for loss in losses) <= allowed(len(losses))


def limit(trials: Sequence[Trial]) -> tuple[float, str]:
    """Return the largest level survived in one direction, and how it is written; 0 where none was."""
    levels: dict[float, list[str | None]] = {}
    for spec, outcome in trials:
        levels.setdefault(float(spec.case["level"]), []).append(None if outcome.success else outcome.stage)
    if any(NO_WALKER in losses for losses in levels.values()):
        return 0.0, "does not walk"
    best = max((level for level, losses in levels.items() if survived(losses)), default=0.0)
    lost = any(not survived(losses) for losses in levels.values())
    return best, f"{best:g}" if lost else f">= {best:g}"


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
        for names in self.options.lift:
            lifted(SafetyLimits.from_profile(), names)

    def cases(self, results: Results) -> Sequence[Case]:
        o = self.options
        return [
            {"lift": lift, "phase": phase, "walk": walk, "direction": direction, "level": level}
            for lift, (phase, walk), direction, level in itertools.product(o.lift, self.gaits, o.direction, o.level)
        ]

    def lifts(self, spec: TrialSpec) -> str:
        return str(spec.case["lift"])

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        rows, short, o = list[tuple[str, ...]](), short_names(outcomes), self.options
        for method, gait, level, lift in itertools.product(outcomes, self.gaits, o.level, o.lift):
            want = {"lift": lift, "phase": gait[0], "walk": gait[1], "level": level}
            mine = [(spec, outcome) for spec, outcome in outcomes[method] if want.items() <= spec.case.items()]
            robots: dict[int, list[bool]] = {}
            for spec, outcome in mine:
                robots.setdefault(spec.index, []).append(outcome.success)
            interval = clustered(list(robots.values())) if mine else Interval(0.0, 1.0)
            survived = f"{sum(map(sum, robots.values()))} of {len(mine)} {interval.text(100.0)}"
            ends = _ends([outcome for _, outcome in mine])
            rows.append((short[method], gait_name(gait), f"{level:g}", lift, survived, ends))
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
