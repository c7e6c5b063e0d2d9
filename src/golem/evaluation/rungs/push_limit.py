"""Rung `push-limit`: the largest push that a lower body survives, by direction and moment."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np

from golem.errors import ConfigError, ModuleFault, unknown_name
from golem.evaluation.base import Case, Outcomes, Results, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Loss
from golem.evaluation.episodes.moments import Moment, Phase, PushedEpisode
from golem.evaluation.episodes.plain_episode import PlainEpisode, own_legs
from golem.evaluation.harness.arguments import robot_options
from golem.evaluation.harness.copies import CAN_COPY, in_a_copy
from golem.evaluation.harness.culprit import trace_of
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.report.svg_figure import method_colour
from golem.evaluation.rungs.leg_rung import NO_WALKER, LegRung, PlantOptions, can_walk, judged, no_walker
from golem.robots.mujoco.shoves import DIRECTIONS, rod, shove
from golem.skills.runner import FAULT
from golem.types import Twist

Terms = Literal["stack", "own"]
SURVIVED = 0.95
"""Share of the trials of a level that has to be survived."""
PATIENCE = 4.0
"""Time after the push that has to be survived [s]."""
QUIET = 0.5
"""Time of quiet standing after which nothing more can happen [s]."""


@dataclass(frozen=True)
class PushLimitOptions(PlantOptions):
    """The search. Levels ascend until one is lost; where the first level is lost they descend instead."""

    kind: Literal["shove", "rod"] = "shove"
    """shove: constant force on the torso for 0.2 s, levels in N s. rod: half a sine of 1 s at the pelvis, in N."""
    terms: tuple[Terms, ...] = ("stack",)
    """stack: with gate, estimator, latency and working arms. own: the robot alone in plain MuJoCo, the true state."""
    phase: tuple[Phase, ...] = ("standing", "left_swing", "right_swing")
    """When the push comes: standing, walking at any moment, or walking while that foot is in the air."""
    direction: tuple[str, ...] = DIRECTIONS
    """Where the push drives the robot."""
    first: float = 10.0
    """First level."""
    step: float = 10.0
    """Distance between levels."""
    last: float = 200.0
    """Highest level."""
    walk: tuple[float, float, float] = (0.3, 0.0, 0.0)
    """vx, vy [m/s] and wz [rad/s] of the phases of walking."""


class PushLimit(LegRung[PushLimitOptions]):
    """Survive ever larger pushes: the largest that 95 of 100 robots survive, by direction and moment."""

    name = "push-limit"
    Options = PushLimitOptions
    default_n = 20
    default_profile = "bench"
    adaptive = True

    def __init__(self, options: PushLimitOptions | None = None) -> None:
        """Check the search; see `Rung`."""
        super().__init__(options)
        o = self.options
        for name in o.direction:
            if name not in DIRECTIONS:
                raise unknown_name("direction", name, DIRECTIONS)
        for option, value in (("first", o.first), ("step", o.step)):
            if value <= 0.0:
                raise ConfigError(f"--{option} is {value:g}; it must be more than 0.")
        if o.last < o.first:
            raise ConfigError(f"--last is {o.last:g}; it must be at least --first, {o.first:g}.")
        for option in ("terms", "phase", "direction"):
            names = getattr(o, option)
            if not names or len(set(names)) < len(names):
                raise ConfigError(f"--{option} names nothing, or one of them twice.")

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        if "own" in self.options.terms:
            own_legs(method)
        return super().config(method, profile, overrides)

    def cases(self, results: Results) -> Sequence[Case]:
        """Return the levels of every direction as far as the results lead."""
        return [
            case
            for terms in self.options.terms
            for phase in self.options.phase
            for direction in self.options.direction
            for case in self._levels(results, terms, phase, direction)
        ]

    def _levels(self, results: Results, terms: str, phase: str, direction: str) -> Iterator[Case]:
        level: float | None = self.options.first
        while level is not None:
            case: Case = {"terms": terms, "phase": phase, "direction": direction, "level": level}
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

    def together(self, spec: TrialSpec) -> Hashable:
        """Return what trials share that have one past: all but level and direction."""
        return spec.method, spec.index, spec.case["terms"], spec.case["phase"]

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        return self.run_together([spec])[0]

    def run_together(self, specs: Sequence[TrialSpec]) -> Sequence[TrialOutcome]:
        """Bring one robot to the moment of the push, and push it from there, each time in a copy of the process."""
        if len(specs) > 1 and not CAN_COPY:
            return [self.run(spec, None) for spec in specs]
        spec = specs[0]
        if spec.case["terms"] == "own":
            path = robot_options(self.options.robot).get("mjcf")
            plain = PlainEpisode(spec.method, None if path is None else Path(path), spec.rng("start"))
            walks = can_walk(plain.envelope)
            return self._from_moment(specs, plain, walks, self._moment(spec).reach_plainly)
        with closing(self.episode(spec)) as episode:
            walks = can_walk(episode.running.envelope)
            return self._from_moment(specs, episode, walks, partial(self._moment(spec).reach, spec))

    def _moment(self, spec: TrialSpec) -> Moment:
        phase: Phase = spec.case["phase"]  # type: ignore[assignment] - checked when the options were read
        return Moment.of(spec, phase, Twist(*self.options.walk))

    def _from_moment(
        self,
        specs: Sequence[TrialSpec],
        episode: PushedEpisode,
        walks: bool,
        reach: Callable[..., Loss | None],
    ) -> Sequence[TrialOutcome]:
        if specs[0].case["phase"] != "standing" and not walks:
            return [no_walker(spec.method) for spec in specs]
        loss = reach(episode)
        if loss is not None:
            return [judged(spec.method, loss, {}) for spec in specs]
        if len(specs) == 1:
            return [self._push(episode, specs[0])]
        return [in_a_copy(partial(self._push, episode, spec)) for spec in specs]

    def _push(self, episode: PushedEpisode, spec: TrialSpec) -> TrialOutcome:
        """Push the robot and wait."""
        make = shove if self.options.kind == "shove" else rod
        push, standing = (
            make(str(spec.case["direction"]), float(spec.case["level"])),
            spec.case["phase"] == "standing",
        )
        start, loss = episode.t, None
        try:
            episode.push(push)
            episode.run(push.duration)
            episode.recorder.quiet = 0.0
            episode.run(PATIENCE, until=lambda: standing and episode.recorder.quiet >= QUIET)
        except ModuleFault as fault:
            loss = Loss(FAULT, fault.reason, trace_of(fault))
        trace = episode.recorder.trace()
        before, after = trace.window(start - 1.0, start), trace.window(start)
        series = {"steps": float(after.steps), "speed_before": float(before.twist[:, 0].mean())}
        if len(after.tilt):
            series["peak_tilt"] = float(after.tilt.max())
        return judged(spec.method, loss or episode.loss, series)

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        """Return the largest push survived, a row per method, terms and phase."""
        o, kind = self.options, self.options.kind
        what = (
            "shove of 0.2 s on the torso [N s]"
            if kind == "shove"
            else "half-sine push of 1 s at the pelvis [N]"
        )
        n = len({spec.index for trials in outcomes.values() for spec, _ in trials})
        rows, short = list[tuple[str, ...]](), short_names(outcomes)
        for method, trials in outcomes.items():
            for terms in o.terms:
                for phase in o.phase:
                    mine = [t for t in trials if (t[0].case["terms"], t[0].case["phase"]) == (terms, phase)]
                    cells = [limit([t for t in mine if t[0].case["direction"] == d]) for d in o.direction]
                    least = min(cells, key=lambda cell: cell[0])[1]
                    rows.append((short[method], terms, phase, *(text for _, text in cells), least))
        directions = (d.replace("_", " ") for d in o.direction)
        return (
            TextTable(
                f"Largest {what} survived in at least {100 * SURVIVED:.0f} % of {n} trials",
                ("lower body", "terms", "phase", *directions, "least"),
                tuple(rows),
                f"A level is lost with {allowed(n) + 1} of {n} trials; >=: the highest one tried was not lost.",
            ),
        )

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        """Draw the largest push survived over its direction, ahead at the top; a plot per terms and phase."""
        o = self.options
        cells, short = [(terms, phase) for terms in o.terms for phase in o.phase], short_names(outcomes)
        angles = np.radians([45.0 * DIRECTIONS.index(direction) for direction in o.direction])
        plots = figure.subplots(1, len(cells), subplot_kw={"projection": "polar"}, squeeze=False)[0]
        for axes, (terms, phase) in zip(plots, cells, strict=True):
            for i, (method, trials) in enumerate(outcomes.items()):
                mine = [t for t in trials if (t[0].case["terms"], t[0].case["phase"]) == (terms, phase)]
                best = [limit([t for t in mine if t[0].case["direction"] == d])[0] for d in o.direction]
                closed = np.append(angles, angles[:1]), [*best, best[0]]
                axes.plot(
                    *closed,
                    "o-",
                    color=method_colour(i),
                    ms=4,
                    label=short[method] if axes is plots[0] else None,
                )
                axes.fill(*closed, color=method_colour(i), alpha=0.12)
            axes.set(theta_offset=np.pi / 2, title=f"{phase.replace('_', ' ')}, {terms}")
            axes.set_xticks(np.radians(45.0 * np.arange(8)), [d.replace("_", " ") for d in DIRECTIONS])
        figure.legend(loc="outside lower center", ncols=3)
        return f"Largest push survived, by direction [{'N s' if o.kind == 'shove' else 'N'}]"


def allowed(n: int) -> int:
    """Return how many of `n` trials a level may lose."""
    return math.floor((1.0 - SURVIVED) * n + 1e-9)


def survived(losses: Sequence[str | None]) -> bool:
    """Return whether a level passed, of whose trials `losses` were lost, None where one was not."""
    return sum(loss is not None for loss in losses) <= allowed(len(losses))


def limit(trials: Sequence[tuple[TrialSpec, TrialOutcome]]) -> tuple[float, str]:
    """Return the largest level survived in one direction, and how it is written; 0 where none was."""
    levels: dict[float, list[str | None]] = {}
    for spec, outcome in trials:
        levels.setdefault(float(spec.case["level"]), []).append(None if outcome.success else outcome.stage)
    if any(NO_WALKER in losses for losses in levels.values()):
        return 0.0, "does not walk"
    best = max((level for level, losses in levels.items() if survived(losses)), default=0.0)
    lost = any(not survived(losses) for losses in levels.values())
    return best, f"{best:g}" if lost else f">= {best:g}"
