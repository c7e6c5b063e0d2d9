"""Rungs `tether` and `stand`: pick one loosened screw, in the hoist or on the robot's own feet.

Both run the same trials: trial `i` of one seed has the same screws, calibration errors and noise on either rung, so
that `golem compare` of two runs says what balancing costs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from golem import registry
from golem.capabilities.arms import quick_ik
from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.grasping.centroid import grasp_pose
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.errors import ConfigError
from golem.evaluation.base import DONE, Case, Outcomes, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import with_modules
from golem.evaluation.episodes.episode import HANGS, READY, Loss, episode_seed, lost
from golem.evaluation.episodes.oracle import GraspTruth, Oracle
from golem.evaluation.episodes.pick_claims import REFUSALS, Fastener, claims
from golem.evaluation.episodes.pick_watch import PickTouches, PickWatch
from golem.evaluation.harness.arguments import read_sweep
from golem.evaluation.metrics.text_table import TextTable
from golem.evaluation.report.svg_figure import condition_plot
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE, BalanceRecorder, BalanceTrace
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.gl import shared_context
from golem.robots.worlds.conditions import NAMES, Conditions, LayoutKind, draw_conditions, world_stream
from golem.runtime.executor import when_stepped
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import FAULT, SkillResult
from golem.skills.pick_config import PickGoal, PickOutcome, PickReport
from golem.slots import KEYS
from golem.stack import Stack, load_stack
from golem.types import SIDES, Array, Side

PAD_REACH = 0.008
"""Half width of a finger pad [m]: a hand further off than this cannot hold the screw."""
STRAYED = 0.1
"""A servo law this far from where it was sent has another object [m] [own: the palm camera is up to 7 cm off]."""
STRAIGHT = 0.087
"""Tilt beyond which an extraction counts as off axis [rad]: 5 deg."""
CALIBRATION = "calibration"
"""Who is to blame where a camera is not where the robot's calibration has it: no module."""


def blame(stage: str, slot: str | None, truth: GraspTruth | None, drop_inside: float | None = None) -> str | None:
    """Return the slot that lost a failed trial.

    Where the hand missed the screw, the larger of the two errors is to blame: where the camera had the screw, or what
    was left from there to the hand (the arm and its calibration). The first is again the larger of two: the camera's
    calibration, or what was seen (perception). A servo law that went to another object than it was sent to has missed
    by itself. Where it did not miss, an off-axis pull is the arm's; a hand that lets go beside the tray, `drop_inside`
    [m] within its rim, was sent there by perception; and the rest is the grip's.
    """
    if truth is None or stage in ("detect", "servo", "safety", FAULT):
        return slot
    if truth.miss > PAD_REACH:
        if truth.strayed > STRAYED:
            return "grasp_method"
        if truth.told < truth.left:
            return "upper_body"
        return CALIBRATION if truth.calibration > truth.seen else "localizer"
    if stage == "extract" and truth.tilt > STRAIGHT:
        return "upper_body"
    return "localizer" if stage == "place" and drop_inside is not None and drop_inside < 0.0 else "grasp_method"


SAID = "said_"
"""Begins the name of the figure that says how a pick ended, by its own word."""


def verdict(said: PickReport, success: bool, doable: bool) -> dict[str, float]:
    """Return how a trial ended, as figures; `doable` is whether a hand reaches a loose screw and the tray."""
    series = {f"{SAID}{said.outcome}": 1.0, "doable": float(doable)}
    if said.outcome in REFUSALS and not success:
        series["refusal_right"] = float(not doable)
    return series


def verdict_tables(outcomes: Mapping[str, Sequence[TrialOutcome]]) -> list[TextTable]:
    """Return one table per method: what was said, how often, and whether it was so."""
    tables: list[TextTable] = []
    for method, rows in outcomes.items():
        lines: list[tuple[str, ...]] = []
        for outcome in PickOutcome:
            mine = [row for row in rows if f"{SAID}{outcome.value}" in row.series]
            could, in_tray = sum(bool(row.series["doable"]) for row in mine), sum(row.success for row in mine)
            right = len(mine) - could if outcome in REFUSALS else in_tray
            if mine:
                counts = len(mine), could, in_tray, right, len(mine) - right
                lines.append((outcome.value, *map(str, counts)))
        if rows:
            heads = ("said", "trials", "could be done", "in the tray", "right", "wrong")
            tables.append(TextTable(f"What {method} said at the end", heads, tuple(lines), VERDICTS))
    return tables


VERDICTS = (
    "Could be done: by the simulator's truth, a hand reaches a loose screw and the tray. A refusal is right where it "
    "could not; anything else where a screw is in the tray."
)
"""The note of what was said at the end."""
HEADING = np.pi / 2
"""Heading of the gripper's x axis, left hand; mirrored for the right [rad]."""
NEAREST = 10
"""Places above the tray that are tried, those first that are near to where an arm works best."""
TURNS = (0.0, 0.4, -0.4)
"""Turns from it that are tried [rad]."""


@cache
def _tools() -> tuple[quick_ik.QuickIK, GoalPostures, PlanningRobot]:
    return quick_ik.QuickIK(), GoalPostures(), PlanningRobot()


def glimpsed(side: Side, position: Array) -> bool:
    """Return whether quick inverse kinematics find a posture as in `reaches`: where they do not, it may still be."""
    ik, _, robot = _tools()
    space, ready = JointSpace(robot, POSTURES["ready"]), POSTURES["ready"][1:]
    starts = [np.append(turn, ready)[None] for turn in quick_ik.TURNS]
    found = (ik.solve(side, T, start) for T in _poses(side, position) for start in starts)
    return any(q is not None and space.verdict(q) == 0 for q in found)


def reaches(side: Side, position: Array) -> bool:
    """Return whether a hand that points straight down can be at (3,) `position` in base_link [m].

    It can if a posture within the gate's range is found, from several starts, in which the robot does not touch itself.
    """
    _, goals, robot = _tools()
    ready, space = POSTURES["ready"], JointSpace(robot, POSTURES["ready"])
    pairs = ((T, None) if side == "left" else (None, T) for T in _poses(side, position))
    return any(len(goals.find(*pair, ready, lambda q: space.verdict(q) == 0, most=1)) for pair in pairs)


def _poses(side: Side, position: Array) -> list[Array]:
    return [grasp_pose(position, (HEADING if side == "left" else -HEADING) + turn) for turn in TURNS]


def doable(fasteners: Sequence[Fastener], drops: Array) -> bool:
    """Return whether a hand reaches a loose screw and a place above the tray.

    Args:
        fasteners: those of the near edge.
        drops: (n, 3) places above the tray in base_link [m].
    """
    loose = np.array([f.in_base for f in fasteners if f.loose])
    return _doable(loose.tobytes(), np.asarray(drops, float).tobytes())


@lru_cache(maxsize=8)
def _doable(loose: bytes, drops: bytes) -> bool:
    """Answer once for all methods of a run, who see the same scene."""
    screws, places = np.frombuffer(loose).reshape(-1, 3), np.frombuffer(drops).reshape(-1, 3)
    for reached in (glimpsed, reaches):
        for side, y in zip(SIDES, (0.2, -0.2), strict=True):
            near = sorted(places, key=lambda p: float(np.hypot(p[0] - 0.4, p[1] - y)))
            if any(reached(side, p) for p in near[:NEAREST]) and any(reached(side, p) for p in screws):
                return True
    return False


LENGTH = 0.06
"""What is judged of a pull [m]: longer than any screw."""


def straightness(poses: Sequence[Array]) -> tuple[float, float] | None:
    """Return how far a hand was beside its line and how far it turned, at most, over the first 60 mm of a pull.

    Args:
        poses: (4, 4) each, of the grasp frame in the order of time. The line is the approach axis of the first.

    Returns:
        Distance [m] and angle [rad]; None where the hand did not move by a millimetre.
    """
    if not poses:
        return None
    T = np.array(poses)
    axis = T[0, :3, 2]
    gone = T[:, :3, 3] - T[0, :3, 3]
    back = -gone @ axis
    within = (np.maximum.accumulate(back) <= LENGTH) & (back >= 0.0)
    if not within.any() or back[within].max() < 0.001:
        return None
    beside = np.linalg.norm(gone + back[:, None] * axis, axis=1)
    turned = np.arccos(np.clip(T[:, :3, 2] @ axis, -1.0, 1.0))
    return float(beside[within].max()), float(turned[within].max())


SLOT = "grasp_method"
"""What the methods of these rungs are."""
STANDING = "stand"
"""Name of the rung, and of the stack, whose robot balances."""
RELEASED = 1.0
"""Time between a robot that balances carrying its weight and its errand [s]."""
SETTLE = 0.5
"""Robot time a dropped screw gets to come to rest [s]."""
ABORTED = ("safety", FAULT, "timeout")
"""Stages at which a skill was ended from outside: not a success, wherever the screw is."""


@dataclass(frozen=True)
class PickOptions:
    """The work place."""

    layout: LayoutKind = "nominal"
    """nominal: pack and tray always stand at the same place. varied: drawn from the trial's seed, as is what it looks
    like and what lies about."""
    world: Literal["pack", "ioniq5"] = "pack"
    """pack: 68 screws at even pitch. ioniq5: the 84 fasteners of a real pack, its rim at 0.857 m plus `height`."""
    label: Literal["screw", "nut"] = "screw"
    """What is picked."""
    sweep: str = ""
    """A condition whose values are tried one by one: NAME=FROM..TO, NAME=FROM..TO:COUNT or NAME=VALUE,VALUE."""


def given(case: Case) -> Case:
    """Return what of a case is a condition of the work place."""
    return {name: value for name, value in case.items() if name in NAMES}


def conditions_of(options: PickOptions, spec: TrialSpec) -> Conditions:
    """Return the conditions of a trial's work place."""
    rng = world_stream(episode_seed(spec.seed, spec.index))
    return draw_conditions(options.layout, given(spec.case), rng, options.world)


def let_go(running: LockstepRunner, robot: MujocoRobot) -> TrialOutcome | None:
    """Wait until a robot stands without its band, and for a while more; return the outcome of one that stays in it."""
    running.executor.run(READY, lambda: not robot.on_gantry, due=when_stepped)
    if robot.on_gantry:
        legs = f"lower_body: {running.stack.choice('lower_body').use}"
        return TrialOutcome(False, HANGS.stage, legs, HANGS.detail)
    running.executor.run(running.executor.t + RELEASED, due=when_stepped)
    return None


class PickRung(Rung[PickOptions]):
    """One screw per trial: seen, approached, grasped, pulled out, dropped in the tray."""

    Options = PickOptions
    default_methods = ("centroid", "visual_servo")
    slot = SLOT
    stack_name: ClassVar[str] = ""
    """The shipped stack that it runs; empty for the one of its own name."""

    def __init__(self, options: PickOptions | None = None) -> None:
        super().__init__(options)
        self._sweep = read_sweep(self.options.sweep)

    def cases(self, results: Results) -> Sequence[Case]:
        return self._sweep

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        stack = self._stack(method, profile, overrides)
        if not issubclass(registry.load("robot", stack.choice("robot").use), MujocoRobot):
            raise ConfigError(
                f"Rung {self.name} judges on the simulator's truth; robot: {stack.choice('robot').use} is not the "
                "twin, 'mujoco'."
            )
        shared_context()
        return {**stack_facts(stack), "goal": asdict(self._goal)}

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        stack = self._stack(spec.method, spec.profile, spec.overrides)
        if self.options.layout != "nominal" or spec.case:
            stack = stack.with_options("robot", layout=self.options.layout, conditions=dict(spec.case))
        if self.options.world != "pack":
            stack = stack.with_options("robot", world=self.options.world)
        running, robot = build(stack, episode_seed(spec.seed, spec.index))
        if self.onlooker is not None:
            self.onlooker(running, robot)
        with closing(robot), closing(Oracle(robot)) as oracle:
            hangs = let_go(running, robot) if self.balances else None
            if hangs is not None:
                return hangs
            before = oracle.fasteners()
            feasible = doable(before, oracle.drop_places())
            touches = PickTouches(robot, before, oracle.T_world_odom)
            watch = PickWatch(running, oracle, BalanceRecorder(robot) if self.balances else None, touches)
            result = running.execute("pick", self._goal, watch=watch)
            running.executor.run(running.executor.t + SETTLE, watch.look, due=watch.due)
            if artefacts is not None and watch.recorder is not None:
                watch.recorder.trace().save(artefacts / TRACE)
            outcome = judge_pick(stack, result, oracle, watch, lost(running, watch.recorder))
            said = result.value if isinstance(result.value, PickReport) else PickReport()
            in_tray = bool(oracle.screws_in_tray())
            right = claims(said, before, oracle.taken(before), in_tray, watch.looked_at)
            ended = verdict(said, outcome.success, feasible)
            return replace(outcome, series={**outcome.series, **touches.series(), **right, **ended})

    def tables(self, outcomes: Outcomes) -> Sequence[TextTable]:
        return verdict_tables({method: [outcome for _, outcome in rows] for method, rows in outcomes.items()})

    def plot(self, outcomes: Outcomes, figure: Any) -> str | None:
        if self.options.layout == "nominal" or self.options.sweep:
            return None
        placed = {
            method: [(conditions_of(self.options, spec), outcome.success) for spec, outcome in rows]
            for method, rows in outcomes.items()
        }
        condition_plot(placed, figure)
        return "Success by condition [%]"

    @property
    def _goal(self) -> PickGoal:
        """Either hand, but at the nominal place, whose tray is on the right."""
        nominal = self.options.layout == "nominal" and not self.options.sweep
        return PickGoal(self.options.label, side="right" if nominal else "either")

    @property
    def balances(self) -> bool:
        """Whether the robot stands on its own feet."""
        return self.name == STANDING

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        if SLOT in overrides:
            raise ConfigError(f"The method is what sits in {SLOT}; leave out --use {SLOT}=...")
        stack = load_stack(self.stack_name or self.name, profile=profile).with_choice(SLOT, method)
        stack = with_modules(stack, overrides)
        if stack.on_ground != self.balances:
            raise ConfigError(
                f"Rung {self.name} has a robot {'on its feet' if self.balances else 'in its hoist'}, and this one is "
                "not; leave out --use robot=..."
            )
        return stack


class TetherRung(PickRung):
    """Pick a screw while the robot hangs in its hoist: perception and manipulation without balance."""

    name = "tether"


class StandRung(PickRung):
    """Pick a screw while the robot balances; the lower body can be replaced with `--use lower_body=...`."""

    name = STANDING


def judge_pick(stack: Stack, result: SkillResult, oracle: Oracle, watch: PickWatch, loss: Loss | None) -> TrialOutcome:
    """Say whether a screw is in the tray and the robot still there, and if not, which module lost it."""
    truth = watch.grasp
    series = {} if truth is None else {f"grasp_{name}": getattr(truth, name) for name in MEASURED}
    pulled = straightness(watch.pull)
    if pulled is not None:
        series |= {"pull_beside": pulled[0], "pull_turn": pulled[1]}
    if watch.drop_inside is not None:
        series["drop_inside"] = watch.drop_inside
    if watch.recorder is not None:
        series |= balance(watch.recorder.trace())
    if loss is not None and result.stage not in ABORTED:
        module = f"lower_body: {stack.choice('lower_body').use}" if stack.on_ground else None
        detail = f"{loss.detail} The errand itself: {result.reason}"
        return TrialOutcome(False, loss.stage, module, detail, result.timings, series, oracle.picture(), loss.trace)
    if oracle.screws_in_tray() and result.stage not in ABORTED:
        return TrialOutcome(True, DONE, None, result.reason, result.timings, series, watch.picture)
    # The skill may believe it succeeded: then the screw was lost between the pull and the tray.
    stage = result.stage if result.stage != DONE else "place"
    slot = blame(stage, result.slot, truth, watch.drop_inside)
    module = None if slot is None else f"{slot}: {stack.choice(slot).use}" if slot in KEYS else slot
    detail = result.reason if result.stage != DONE else "The skill reports success, but no screw is in the tray."
    picture = watch.last_picture()
    return TrialOutcome(False, stage, module, detail, result.timings, series, picture, result.trace)


def balance(stood: BalanceTrace) -> dict[str, float]:
    """Return how a robot stood that worked."""
    if not len(stood.t):
        return {}
    return {
        "margin_median": float(np.median(stood.margin)),
        "margin_min": float(stood.margin.min()),
        "below_zero": stood.below_zero,
        "sway": stood.sway,
        "steps": float(stood.steps),
    }


MEASURED = ("aim", "reach", "miss", "depth", "tilt")
"""What of a `GraspTruth` is recorded."""
