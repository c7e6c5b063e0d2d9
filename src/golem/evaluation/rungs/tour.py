"""Rung `tour`: ninety seconds from waypoint to waypoint, arms restless, punched ever harder, in any engine.

The task is that of the public league rhoyn/teleop-walking-benchmark, which is for the G1; see docs/reference/tour.md.
"""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.postures import POSTURES, mirror
from golem.capabilities.arms.trajectory import gate_limits
from golem.errors import ConfigError
from golem.evaluation.base import Outcomes, TrialOutcome, TrialSpec
from golem.evaluation.episodes.episode import Episode, Loss
from golem.evaluation.episodes.scripted_motion import ScriptedMotion
from golem.evaluation.metrics.statistics import Interval, PairedTable, mcnemar, mean_interval, paired_difference
from golem.evaluation.metrics.text_table import TextTable, short_names
from golem.evaluation.report.svg_figure import method_colour
from golem.evaluation.rungs.leg_rung import NO_WALKER, LegRung, PlantOptions, can_walk, judged, lifted
from golem.hardware.safety.base import SafetyLimits
from golem.interfaces import topics
from golem.interfaces.payloads import JointTrajectory
from golem.provenance import stack_facts
from golem.robots.model.pinocchio_model import Kinematics
from golem.robots.model.table import BASE_LINK, JOINT_NAMES, JOINTS
from golem.stack import Stack
from golem.types import LEGS, NUM_JOINTS, UPPER, Array, PlanarPose, Twist

CENTRE, RADIUS = 0.3, 0.75
"""The waypoints' disc: its centre ahead of where the tour begins, and its radius [m]."""
GAIN = 1.5
"""Speed per distance, and yaw rate per heading error [1/s]."""
ARRIVED, LEFT = (0.10, 0.05), (0.20, 0.12)
"""Distance [m] and heading error [rad] from which the operator lets the robot rest, and steers it again."""
PUNCH, FIRST, RAMP = 500.0 / 35.1, 1.0 / 3.0, 12
"""Largest force by the mass of the robot [N/kg], the league's and the sum over its assets/g1_29dof.xml; the share of it
that is the ceiling at the start, and after how many punches, a minute's, it is all."""
DELAY, LASTS = 0.1, 0.08
"""When after its waypoint is named a punch begins, and how long it lasts [s]."""
ARM_PERIOD, ARM_STEP, ARM_STEPS, ARM_DRAWS = 0.5, 0.06, 25, 8
"""Time between two places of the arms [s]; steps [rad] to the next, how many; how often it is drawn at most."""
ARM_ROOM = 0.5
"""How far each joint goes from the posture `home` [rad] [own: the league's have their range, but no gate]."""
HAND_BOX = ((0.10, 0.15, -0.2), (0.80, 0.80, 0.60))
"""Where the left hand stays in base_link [m]: ahead and below the head, as in the league, and on its side [own]."""


def draw_waypoints(rng: np.random.Generator, count: int) -> list[PlanarPose]:
    """Return waypoints in the frame in which the tour begins: evenly over the disc, with any heading."""
    polar = [(RADIUS * math.sqrt(rng.uniform()), *rng.uniform(-math.pi, math.pi, 2)) for _ in range(count)]
    return [PlanarPose(CENTRE + r * math.cos(bearing), r * math.sin(bearing), yaw) for r, bearing, yaw in polar]


def draw_punches(rng: np.random.Generator, count: int, mass: float) -> list[tuple[str, Array]]:
    """Return a punch per waypoint for a robot of `mass` [kg]: any joint, any direction, ever harder.

    Each is a link, at whose origin it acts: the child of a joint, which is there; and the (3,) force in the world [N].
    """
    punches: list[tuple[str, Array]] = []
    for k in range(count):
        joint, direction = JOINTS[rng.integers(len(JOINTS))], rng.normal(size=3)
        ceiling = PUNCH * mass * (FIRST + (1.0 - FIRST) * min(k / RAMP, 1.0))
        punches.append((joint.child, ceiling * rng.uniform(0.5, 1.0) * direction / np.linalg.norm(direction)))
    return punches


def draw_arms(rng: np.random.Generator, seconds: float) -> tuple[Array, Array]:
    """Return times (n,) [s] and joints (n, 15) [rad] of arms that move at random; the right one mirrors the left."""
    home, kinematics, q = POSTURES["home"], Kinematics(), np.zeros(NUM_JOINTS)
    left, right = ARM_COLUMNS["left"], ARM_COLUMNS["right"]
    low, high = (np.clip(home + way * ARM_ROOM, *gate_limits()[:2])[left] for way in (-1.0, 1.0))
    places, place, count = list[Array](), home, math.ceil(seconds / ARM_PERIOD)
    for _ in range(count):
        for _ in range(ARM_DRAWS):
            drawn = place.copy()
            for step in rng.uniform(-ARM_STEP, ARM_STEP, (ARM_STEPS, len(low))):
                drawn[left] = np.clip(drawn[left] + step, low, high)
            drawn[right] = mirror(drawn)[right]
            q[UPPER] = drawn
            kinematics.update(q)
            hand = kinematics.pose("left_gripper")[:3, 3]
            if np.all(hand >= HAND_BOX[0]) and np.all(hand <= HAND_BOX[1]):
                place = drawn
                break
        places.append(place)
    return np.linspace(ARM_PERIOD, count * ARM_PERIOD, count), np.array(places)


class Operator:
    """Steers a robot to a waypoint from where it really is, as the league's harness does: no module sees that place.

    It asks for a velocity in proportion to distance and heading error; the lower body's envelope cuts it. Within
    `ARRIVED` it asks for nothing until the robot is off by more than `LEFT`; place and heading each by itself.
    """

    def __init__(self, goal: PlanarPose) -> None:
        self._goal, self._rests = goal, [False, False]

    def steer(self, place: PlanarPose) -> Twist:
        """Return what to ask of a robot at `place`, given in the frame of the goal."""
        left = place.to(self._goal)
        for i, error in enumerate(errors(left)):
            self._rests[i] = error <= LEFT[i] if self._rests[i] else error < ARRIVED[i]
        go, turn = (0.0 if rests else GAIN for rests in self._rests)
        return Twist(go * left.x, go * left.y, turn * left.yaw)


def errors(left: PlanarPose) -> tuple[float, float]:
    """Return distance [m] and heading error [rad] of a robot that has `left` to go."""
    return math.hypot(left.x, left.y), abs(left.yaw)


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
        lifted(SafetyLimits.from_profile(), self.options.lift)

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        if "robot" in overrides:
            raise ConfigError("The rung tour has its engines by --engine; leave out --use robot=...")
        stacks = {e: self.stack(method, profile, {**overrides, "robot": e}) for e in self.options.engine}
        return {engine: stack_facts(stack) for engine, stack in stacks.items()}

    def trial_stack(self, spec: TrialSpec) -> Stack:
        return self.stack(spec.method, spec.profile, {**spec.overrides, "robot": str(spec.case["engine"])})

    def lifts(self, spec: TrialSpec) -> str:
        return self.options.lift

    def trial(self, spec: TrialSpec, episode: Episode) -> TrialOutcome:
        robot = episode.robot
        model, data = robot.scene.model, robot.data
        mass = float(model.body_subtreemass[model.body(BASE_LINK).id])
        speeds = model.jnt_dofadr[model.actuator_trnid[LEGS, 0]]
        goals = draw_waypoints(spec.rng("waypoints"), WAYPOINTS)
        punches = draw_punches(spec.rng("punches"), WAYPOINTS, mass)
        arms, twist = draw_arms(spec.rng("arms"), WAYPOINTS * SEGMENT), Twist()
        episode.stand(SETTLE)
        episode.running.bus.publish(topics.ARM_TRAJECTORY, JointTrajectory(episode.t, *arms), episode.t)
        episode.start(ScriptedMotion(twist=lambda t: twist))
        start, began, clock = robot.truth.pose(), episode.t, time.process_time()
        work, ends = 0.0, list[tuple[float, float]]()
        for goal, (link, force) in zip(goals, punches, strict=True):
            operator = Operator(start @ goal)
            for k in range(round(SEGMENT / PERIOD)):
                twist = operator.steer(robot.truth.pose())
                hit = DELAY <= (k + 0.5) * PERIOD < DELAY + LASTS
                robot.push(force if hit else np.zeros(3), link, np.zeros(3))
                episode.run(PERIOD)
                if episode.over:
                    break
                work += PERIOD * float(np.abs(data.ctrl[LEGS] * data.qvel[speeds]).sum())
            if episode.over:
                break
            ends.append(errors(robot.truth.pose().to(start @ goal)))
        seconds, cpu = episode.t - began, time.process_time() - clock
        base = episode.recorder.trace().window(began).base[:: round(SEGMENT / 10 / 0.01), :2]
        way = float(np.linalg.norm(np.diff(base, axis=0), axis=1).sum())
        near = sum(distance <= LEFT[0] and turn <= LEFT[1] for distance, turn in ends)
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
        short, rows = short_names(outcomes), list[tuple[str, ...]]()
        for method, trials in outcomes.items():
            (first, ours), *others = _by_engine(trials).items()
            rows += [(short[method], f"{first} - {other}", *_gap(ours, theirs)) for other, theirs in others]
        columns = ("lower body", "engines", "n", "tours completed [points]", "McNemar p", "time survived [s]")
        return (TextTable("Gap between engines on the same tours", columns, tuple(rows)),) if rows else ()

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
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
