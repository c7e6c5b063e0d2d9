"""Rung `tour`: ninety seconds from waypoint to waypoint, arms restless, punched ever harder, in any engine."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.base import Outcomes, TrialOutcome, TrialSpec
from golem.evaluation.episodes import league_tour as league
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.scripted_motion import ScriptedMotion
from golem.evaluation.metrics.statistics import Interval, PairedTable, mcnemar, mean_interval, paired_difference
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.report.svg_figure import method_colour
from golem.evaluation.rungs.gate_limits import lifted
from golem.evaluation.rungs.leg_rung import NO_WALKER, LegRung, PlantOptions, can_walk, judged
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import topics
from golem.interfaces.payloads import JointTrajectory
from golem.provenance import stack_facts
from golem.robots.model.table import BASE_LINK, JOINT_NAMES
from golem.stack import Stack
from golem.types import LEGS, UPPER, Twist

WAYPOINTS, SEGMENT = 18, 5.0
"""Waypoints of a tour, and the time for each [s]."""
SETTLE, PERIOD = 3.0, 0.02
"""Time between a robot carrying its weight and the tour, and between two looks of the operator [s]."""


@dataclass(frozen=True)
class TourOptions(PlantOptions):
    """The engines, and the gate."""

    engine: tuple[str, ...] = ("mujoco",)
    """Engines, each with the same tours: mujoco, physx, isaaclab, or with options "{use: NAME, option: value}"."""
    lift: str = "stops"
    """What is lifted of the safety gate, see rung gate-limits: the league's robots have none. stops: it only clips."""


class Tour(LegRung[TourOptions]):
    """Walk to 18 waypoints in 90 s, arms in random motion, a punch on a random joint every 5 s, in several engines."""

    name = "tour"
    varied = {"engine": "engine"}
    Options = TourOptions
    provokes = True
    default_n = 64
    default_profile = "bench"

    def __init__(self, options: TourOptions | None = None) -> None:
        super().__init__(options)
        self._each("engine")
        lifted(SafetyLimits.from_profile(), self.options.lift)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        if "robot" in overrides:
            raise ConfigError("The rung tour has its engines by --engine; leave out --use robot=...")
        stacks = {e: self.stack(method, profile, {**overrides, "robot": e}) for e in self.options.engine}
        return {engine: stack_facts(stack) for engine, stack in stacks.items()}

    def trial_stack(self, spec: TrialSpec) -> Stack:
        """Return the stack of a trial, in the engine of its case."""
        return self.stack(spec.method, spec.profile, {**spec.overrides, "robot": str(spec.case["engine"])})

    def limits(self, spec: TrialSpec, stack: Stack) -> SafetyLimits:
        """Return those that are not lifted; see `LegRung`."""
        return lifted(SafetyLimits.from_profile(stack.limits), self.options.lift)

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        robot = episode.robot
        model, data = robot.scene.model, robot.data
        mass = float(model.body_subtreemass[model.body(BASE_LINK).id])
        speeds = model.jnt_dofadr[model.actuator_trnid[LEGS, 0]]
        goals = league.draw_waypoints(spec.rng("waypoints"), WAYPOINTS)
        punches = league.draw_punches(spec.rng("punches"), WAYPOINTS, mass)
        arms, twist = league.draw_arms(spec.rng("arms"), WAYPOINTS * SEGMENT), Twist()
        episode.stand(SETTLE)
        episode.running.bus.publish(topics.ARM_TRAJECTORY, JointTrajectory(episode.t, *arms), episode.t)
        episode.start(ScriptedMotion(twist=lambda t: twist))
        start, began, clock = robot.truth.pose(), episode.t, time.process_time()
        work, ends = 0.0, list[tuple[float, float]]()
        for goal, (link, force) in zip(goals, punches, strict=True):
            operator = league.Operator(start @ goal)
            for k in range(round(SEGMENT / PERIOD)):
                twist = operator.steer(robot.truth.pose())
                hit = league.DELAY <= (k + 0.5) * PERIOD < league.DELAY + league.LASTS
                robot.push(force if hit else np.zeros(3), link, np.zeros(3))
                episode.run(PERIOD)
                if episode.over:
                    break
                work += PERIOD * float(np.abs(data.ctrl[LEGS] * data.qvel[speeds]).sum())
            if episode.over:
                break
            ends.append(league.errors(robot.truth.pose().to(start @ goal)))
        seconds, cpu = episode.t - began, time.process_time() - clock
        base = episode.recorder.trace().window(began).base[:: round(SEGMENT / 10 / 0.01), :2]
        way = float(np.linalg.norm(np.diff(base, axis=0), axis=1).sum())
        near = sum(distance <= league.LEFT[0] and turn <= league.LEFT[1] for distance, turn in ends)
        series = {"seconds": seconds, "lived": len(ends) / WAYPOINTS, "reached": near / WAYPOINTS}
        series |= {"distance": way, "work": work}
        if ends:
            series |= dict(zip(("goal_radial", "goal_turn"), np.mean(ends, axis=0).tolist(), strict=True))
        if way > 1.0:
            series["transport"] = work / (-mass * float(model.opt.gravity[2]) * way)
        loss = episode.loss
        if loss is None and not can_walk(episode.running.envelope):
            loss = Loss(NO_WALKER, "It is on its feet, but does not walk: its envelope is empty.")
        pace = {"pace": seconds / cpu} if seconds > 0.0 else {}
        outcome = replace(judged(spec.method, loss, series), costs=pace)
        # A punch has thrown an arm past what the gate bears: no module did that.
        thrown = outcome.stage == "safety" and any(name in outcome.detail for name in JOINT_NAMES[UPPER])
        return replace(outcome, module=None) if thrown else outcome

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        """Return what another engine than the first changes, tour by tour."""
        short, rows = short_names(outcomes), list[tuple[str, ...]]()
        for method, trials in outcomes.items():
            (first, ours), *others = _by_engine(trials).items()
            rows += [(short[method], f"{first} - {other}", *_gap(ours, theirs)) for other, theirs in others]
        columns = ("lower body", "engines", "n", "tours completed [points]", "McNemar p", "time survived [s]")
        return (TextTable("Gap between engines on the same tours", columns, tuple(rows)),) if rows else ()

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        """Draw who is still on the tour over time: a colour per method, a line per engine."""
        axes, short = figure.subplots(), short_names(outcomes)
        for i, (method, trials) in enumerate(outcomes.items()):
            lines = itertools.cycle(("-", "--", ":", "-."))
            for (engine, found), line in zip(_by_engine(trials).items(), lines, strict=False):
                lost = sorted(_seconds(outcome) for outcome in found.values() if not outcome.success)
                left = 100.0 * (1.0 - np.arange(len(lost) + 1) / len(found))
                times, name = [0.0, *lost, WAYPOINTS * SEGMENT], f"{short[method]}, {engine}"
                axes.step(times, [*left, left[-1]], line, where="post", color=method_colour(i), lw=2, label=name)
        axes.set(xlabel="time on the tour [s]", ylabel="still on it [%]", xlim=(0, WAYPOINTS * SEGMENT), ylim=(0, 103))
        figure.legend(loc="outside lower center", ncols=3)
        return "Survival on the tour"


def _by_engine(trials: Sequence[tuple[TrialSpec, TrialOutcome]]) -> dict[str, dict[int, TrialOutcome]]:
    found: dict[str, dict[int, TrialOutcome]] = {}
    for spec, outcome in trials:
        found.setdefault(str(spec.case["engine"]), {})[spec.index] = outcome
    return found


def _gap(ours: Mapping[int, TrialOutcome], theirs: Mapping[int, TrialOutcome]) -> tuple[str, ...]:
    """Return pairs, difference of tours completed, p, and difference of survival."""
    pairs = [(ours[i], theirs[i]) for i in sorted(ours.keys() & theirs.keys())]
    table = PairedTable.count([a.success for a, _ in pairs], [b.success for _, b in pairs])
    points, seconds = (table.only_a - table.only_b) / table.n, [_seconds(a) - _seconds(b) for a, b in pairs]
    survival = _quoted(float(np.mean(seconds)), mean_interval(seconds))
    return str(table.n), _quoted(points, paired_difference(table), 100.0), f"{mcnemar(table):.2g}", survival


def _quoted(value: float, interval: Interval | None, scale: float = 1.0) -> str:
    bounds = f" {interval.text(scale, '+')}" if interval else ""
    return f"{scale * value:+.3g}{bounds}"


def _seconds(outcome: TrialOutcome) -> float:
    return outcome.series.get("seconds", 0.0)  # a trial that timed out has none
