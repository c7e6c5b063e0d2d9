"""Rung `tour`: ninety seconds from waypoint to waypoint, arms restless, punched ever harder, in any engine."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from golem.errors import ConfigError
from golem.evaluation.base import DONE, Case, Outcomes, Results, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss, episode_seed
from golem.evaluation.episodes.league_tour import (
    DELAY,
    LASTS,
    LEFT,
    SEGMENT,
    Operator,
    TourMotion,
    draw_arms,
    draw_punches,
    draw_waypoints,
)
from golem.evaluation.metrics.statistics import PairedTable, mcnemar, mean_interval, paired_difference, wilson
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.report.svg_figure import method_colour
from golem.evaluation.rungs.gate_limits import lifted
from golem.evaluation.rungs.leg_rung import NO_WALKER, LegRung, PlantOptions, can_walk, judged
from golem.hardware.safety.base import SafetyLimits
from golem.provenance import stack_facts
from golem.robots.model.table import BASE_LINK, JOINT_NAMES
from golem.types import LEGS, UPPER

WAYPOINTS = 18
"""Waypoints of a tour."""
SETTLE = 3.0
"""Time between a robot carrying its weight and the tour [s]."""
PERIOD = 0.02
"""Time between two looks of the operator [s]."""
GRAVITY = 9.81
"""[m/s^2]."""


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
    Options = TourOptions
    provokes = True
    default_n = 64
    default_profile = "bench"

    def cases(self, results: Results) -> Sequence[Case]:
        """Return every engine."""
        return [{"engine": engine} for engine in dict.fromkeys(self.options.engine)]

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        if "robot" in overrides:
            raise ConfigError("The rung tour has its engines by --engine; leave out --use robot=...")
        lifted(SafetyLimits.from_profile(), self.options.lift)
        stacks = {e: self.stack(method, profile, {**overrides, "robot": e}) for e in self.options.engine}
        return {engine: stack_facts(stack) for engine, stack in stacks.items()}

    def episode(self, spec: TrialSpec) -> Episode:
        """Return the robot of a trial, in the engine of its case."""
        stack = self.stack(spec.method, spec.profile, {**spec.overrides, "robot": str(spec.case["engine"])})
        limits = lifted(SafetyLimits.from_profile(stack.limits), self.options.lift)
        return Episode(stack, episode_seed(spec.seed, spec.index), self.onlooker, limits)

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        """Run one trial; see `LegRung`."""
        robot = episode.robot
        model, data = robot.scene.model, robot.data
        mass = float(model.body_subtreemass[model.body(BASE_LINK).id])
        speeds = model.jnt_dofadr[model.actuator_trnid[LEGS, 0]]
        goals = draw_waypoints(spec.rng("waypoints"), WAYPOINTS)
        punches = draw_punches(spec.rng("punches"), WAYPOINTS, mass)
        motion = TourMotion(draw_arms(spec.rng("arms"), WAYPOINTS * SEGMENT))
        episode.stand(SETTLE)
        episode.start(motion)
        start, began, clock = robot.truth.pose(), episode.t, time.process_time()
        work, ends = 0.0, list[tuple[float, float]]()
        for goal, punch in zip(goals, punches, strict=True):
            operator = Operator(start @ goal)
            for k in range(round(SEGMENT / PERIOD)):
                motion.twist = operator.steer(robot.truth.pose())
                hit = DELAY <= (k + 0.5) * PERIOD < DELAY + LASTS
                robot.push(punch.force if hit else np.zeros(3), punch.link, np.zeros(3))
                episode.run(PERIOD)
                if episode.over:
                    break
                work += PERIOD * float(np.abs(data.ctrl[LEGS] * data.qvel[speeds]).sum())
            if episode.over:
                break
            operator.steer(robot.truth.pose())
            ends.append(operator.errors)
        seconds, cpu = episode.t - began, time.process_time() - clock
        base = episode.recorder.trace().window(began).base[:: round(SEGMENT / 10 / 0.01), :2]
        way = float(np.linalg.norm(np.diff(base, axis=0), axis=1).sum())
        near = sum(distance <= LEFT[0] and turn <= LEFT[1] for distance, turn in ends)
        series = {"seconds": seconds, "lived": len(ends) / WAYPOINTS, "reached": near / WAYPOINTS}
        series |= {"distance": way, "work": work}
        if ends:
            series |= dict(zip(("waypoint_error", "waypoint_turn"), np.mean(ends, axis=0).tolist(), strict=True))
        if way > 1.0:
            series["transport"] = work / (mass * GRAVITY * way)
        loss = episode.loss
        if loss is None and not can_walk(episode.running.envelope):
            loss = Loss(NO_WALKER, "It is on its feet, but does not walk: its envelope is empty.")
        pace = {"pace": seconds / cpu} if seconds > 0.0 else {}
        outcome = replace(judged(spec.method, loss, series), costs=pace)
        # A punch has thrown an arm past what the gate bears: no module did that.
        thrown = outcome.stage == "safety" and any(name in outcome.detail for name in JOINT_NAMES[UPPER])
        return replace(outcome, module=None) if thrown else outcome

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        """Return the league's columns, a row per method and engine, and what another engine changes, tour by tour."""
        short, rows, gaps = short_names(outcomes), list[tuple[str, ...]](), list[tuple[str, ...]]()
        for method, trials in outcomes.items():
            first, *others = groups = list(_by_engine(trials))
            for engine, found in groups:
                won = [outcome.success for outcome in found.values()]
                cells = (_mean(found, name, scale) for name, scale in COLUMNS.values())
                share = wilson(sum(won), len(won))
                percent = f"{100 * np.mean(won):.3g} [{100 * share.low:.3g}, {100 * share.high:.3g}]"
                rows.append((short[method], engine, str(len(won)), percent, *cells))
            gaps += [(short[method], f"{first[0]} - {engine}", *_gap(first[1], found)) for engine, found in others]
        heads = ("lower body", "engine", "n", "tours completed [%]", *COLUMNS)
        note = (
            "Means with 95 % intervals, over all tours. Reached: within "
            f"{LEFT[0]:g} m and {LEFT[1]:g} rad at the end of its {SEGMENT:g} s; errors: then, of waypoints seen."
        )
        tour = TextTable("The tour", heads, tuple(rows), note)
        if not gaps:
            return (tour,)
        columns = ("lower body", "engines", "n", "tours completed [points]", "McNemar p", "survived [s]")
        return tour, TextTable("Gap between engines, the same tours", columns, tuple(gaps), "95 % intervals of pairs.")

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        """Draw who is still on the tour over time: a colour per method, a line per engine."""
        axes, short = figure.subplots(), short_names(outcomes)
        for i, (method, trials) in enumerate(outcomes.items()):
            for (engine, found), line in zip(_by_engine(trials), ("-", "--", ":", "-.") * len(trials), strict=False):
                lost = sorted(o.series["seconds"] for o in found.values() if o.stage != DONE and "seconds" in o.series)
                share = 100.0 * (1.0 - np.arange(len(lost) + 1) / len(found))
                times, shares = [0.0, *lost, WAYPOINTS * SEGMENT], [*share, share[-1]]
                name = f"{short[method]}, {engine}"
                axes.step(times, shares, line, where="post", color=method_colour(i), lw=2, label=name)
        axes.set(
            xlabel="time on the tour [s]", ylabel="still on it [%]", xlim=(0.0, WAYPOINTS * SEGMENT), ylim=(0, 103)
        )
        figure.legend(loc="outside lower center", ncols=3)
        return "Survival on the tour"


Found = Mapping[int, TrialOutcome]
"""Index of a trial -> what became of it."""
COLUMNS: dict[str, tuple[str, float]] = {
    "survived [s]": ("seconds", 1.0),
    "waypoints lived to see [%]": ("lived", 100.0),
    "reached [%]": ("reached", 100.0),
    "place [cm]": ("waypoint_error", 100.0),
    "heading [deg]": ("waypoint_turn", np.degrees(1.0)),
    "way [m]": ("distance", 1.0),
    "work [kJ]": ("work", 1e-3),
    "cost of transport": ("transport", 1.0),
}
"""Column of the table -> the scalar that it is the mean of, and its unit per SI unit."""


def _by_engine(trials: Sequence[tuple[TrialSpec, TrialOutcome]]) -> Iterator[tuple[str, Found]]:
    for engine in dict.fromkeys(str(spec.case["engine"]) for spec, _ in trials):
        yield engine, {spec.index: outcome for spec, outcome in trials if spec.case["engine"] == engine}


def _mean(found: Found, name: str, scale: float) -> str:
    return _quoted([scale * outcome.series[name] for outcome in found.values() if name in outcome.series])


def _quoted(values: Sequence[float], sign: str = "") -> str:
    interval = mean_interval(values)
    if not values:
        return "-"
    return f"{np.mean(values):{sign}.3g}" + (
        f" [{interval.low:{sign}.3g}, {interval.high:{sign}.3g}]" if interval else ""
    )


def _gap(one: Found, other: Found) -> tuple[str, ...]:
    """Return the cells of a gap: pairs, difference of tours completed, p, and difference of survival."""
    pairs = [(one[i], other[i]) for i in sorted(one.keys() & other.keys())]
    table = PairedTable.count([a.success for a, _ in pairs], [b.success for _, b in pairs])
    low_high = paired_difference(table) if pairs else None
    points = 100.0 * (table.only_a - table.only_b) / max(table.n, 1)
    cell = f"{points:+.3g} [{100 * low_high.low:+.3g}, {100 * low_high.high:+.3g}]" if low_high else "-"
    seconds = [a.series["seconds"] - b.series["seconds"] for a, b in pairs if "seconds" in a.series | b.series]
    return str(table.n), cell, f"{mcnemar(table):.2g}", _quoted(seconds, "+")
