"""Rung `var-stand`: walk to the pack, or stand before it as badly as the paper's robot did, then pick standing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from golem.capabilities.arms.reach_map import load_map
from golem.capabilities.navigation.goto import GoTo
from golem.errors import ConfigError
from golem.evaluation.base import Case, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import with_modules
from golem.evaluation.episodes.episode import Episode, Loss, episode_seed, lost
from golem.evaluation.episodes.oracle import ContactWatch, Oracle, errors, place_error
from golem.evaluation.episodes.pick_claims import claims
from golem.evaluation.episodes.pick_watch import PickTouches, PickWatch
from golem.evaluation.rungs.navigate_hall import DISTANCE, SPREAD, surveyed
from golem.evaluation.rungs.pick_screw import SETTLE, PickOptions, PickRung, balance, given, judge_pick
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.mujoco.balance import TRACE, BalanceRecorder
from golem.robots.worlds.conditions import LayoutKind
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.disassemble_goal import DisassembleGoal, DisassembleReport
from golem.skills.dock import APPROACH, approach
from golem.skills.navigate import NavigateGoal
from golem.skills.pack_job import CONTENT, STAGE
from golem.skills.pick_config import PickGoal, PickOutcome, PickReport
from golem.stack import Stack, load_stack
from golem.types import SIDES, Array, PlanarPose

Start = Literal["placed", "walked"]
Docking = Literal["no", "yes"]
PLACEMENT = (0.0683, 0.1143)
"""Standard deviations of the paper's placement ahead and to the left [m]: a mean radial error of 13.0 cm."""
TURN = math.radians(4.0)
"""The same of the heading [rad] [own: the paper gives none]."""
STILL = 4.0
"""Time the robot stands before anything begins [s]: the odometry starts from rest."""
WALK = 120.0
"""Time it gets for the walk [s]."""
HERE = PlanarPose(0.0, 0.0, 0.0)
NOWHERE_TO_WORK = (PickOutcome.OUT_OF_REACH, PickOutcome.TRAY_MISSING, PickOutcome.TRAY_OUT_OF_REACH)
"""What a pick says of a robot that stands where it cannot work."""


@dataclass(frozen=True)
class VarStandOptions(PickOptions):
    """The work place, and how the robot comes to it."""

    layout: LayoutKind = "varied"
    """nominal or varied; see the rung `stand`."""
    start: tuple[Start, ...] = ("placed", "walked")
    """placed: it begins where the paper's distribution of placement errors puts it. walked: it walks there, 6 m through
    a hall with walls and obstacles, by a map from before."""
    dock: tuple[Docking, ...] = ("no", "yes")
    """no: it picks from where it came to stand. yes: it docks before, and again where a pick says out of reach."""
    obstacles: int = 4
    """Walls and obstacles in the way."""


class ByMap:
    """Steps from the place to which the navigator came to a pose, by odometry and map alone."""

    async def run(self, context: Context, goal: PlanarPose) -> SkillResult:
        """Go there, `goal` in the map; see `Routine`."""
        await approach(context, GoTo(APPROACH), context.T_odom_map @ goal)
        return SkillResult(True, "done", None, "Standing where the map says.")


class VarStandRung(PickRung):
    """Stand where the walk ended, or where the paper's placement error puts the robot, then pick a screw.

    Each index has the same start, pack and errors with and without docking. Where no loose screw is within reach of
    either hand by the truth, the stance lost the trial: the module that believed wrongly where it was, or the one that
    stopped short, is named. Otherwise it is judged as on the rung `stand`.
    """

    name = "var-stand"
    Options = VarStandOptions
    options: VarStandOptions
    default_methods = ("visual_servo",)
    varied = {"start": "start", "dock": "dock"}

    def cases(self, results: Results) -> Sequence[Case]:
        return [{**condition, **own} for condition in super().cases(results) for own in Rung.cases(self, results)]

    @property
    def balances(self) -> bool:
        return True

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        seed, walks = episode_seed(spec.seed, spec.index), spec.case["start"] == "walked"
        stance = drawn_stance(spec, walks)
        stack = self._stack(spec.method, spec.profile, spec.overrides).with_options(
            "robot",
            layout=self.options.layout,
            conditions=given(spec.case),
            stance=[stance.x, stance.y, stance.yaw],
            world={"pack": "plant", "ioniq5": "ioniq5_plant"}[self.options.world] if walks else self.options.world,
            obstacles=self.options.obstacles if walks else 0,
        )
        with TemporaryDirectory() as folder:
            if walks:
                stack = surveyed(stack, spec, Path(folder))
            with closing(Episode(stack, seed, self.onlooker)) as episode:
                trial = _Trial(spec, stack, episode, stance, self.options.label)
                outcome = trial.run()
                if artefacts is not None and trial.recorder is not None:
                    trial.recorder.trace().save(artefacts / TRACE)
                return outcome

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        if "robot" in overrides or "grasp_method" in overrides:
            raise ConfigError("This rung brings robot and grasp method itself; leave out --use of both.")
        stack = load_stack("hall", profile=profile).with_choice("grasp_method", method)
        return with_modules(stack, overrides)


class _Trial:
    """One trial on its way."""

    def __init__(self, spec: TrialSpec, stack: Stack, episode: Episode, stance: PlanarPose, label: str) -> None:
        self._spec, self._stack, self._episode, self._stance = spec, stack, episode, stance
        self._label = label
        self._docks = 3 if spec.case["dock"] == "yes" else 0
        self._oracle = Oracle(episode.robot)
        self._contacts = ContactWatch(episode.robot)
        self._series: dict[str, float] = {}
        self.recorder: BalanceRecorder | None = None

    def run(self) -> TrialOutcome:
        """Come to the pack, pick, and judge."""
        with closing(self._oracle):
            episode = self._episode
            episode.stand(STILL)
            if episode.loss is None and self._spec.case["start"] == "walked":
                came = self._come()
                if came is not None:
                    return came
            if episode.loss is not None:
                return self._failed(episode.loss, "lower_body")
            self._series |= self._placed("before")
            return self._pick()

    def _come(self) -> TrialOutcome | None:
        """Walk to the pack; return how that failed, or None where it did not."""
        stage = self._stance @ PlanarPose(-STAGE, 0.0, 0.0)
        came = self._walk("navigate", NavigateGoal(stage.x, stage.y, stage.yaw, "map", WALK, CONTENT))
        return came or (None if self._docks else self._walk(ByMap(), self._stance))

    def _walk(self, skill: str | ByMap, goal: object) -> TrialOutcome | None:
        """Pursue one skill that moves the legs; return how it failed, or None where it did not."""
        episode = self._episode
        episode.start(skill, goal)
        episode.run(WALK, self._look)
        result = episode.result
        if episode.loss is not None:
            return self._failed(episode.loss, "lower_body")
        if result is None:
            return self._failed(Loss("timeout", f"It is not there after {WALK:g} s."), "navigator")
        if not result.success:
            return self._failed(Loss(result.stage, result.reason, result.trace), result.slot or "navigator")
        return None

    def _look(self) -> bool:
        self._contacts(self._episode.t)
        return self._episode.result is not None

    def _pick(self) -> TrialOutcome:
        running, robot = self._episode.running, self._episode.robot
        oracle, before = self._oracle, self._oracle.fasteners()
        touches = PickTouches(robot, before, oracle.T_world_odom)
        self.recorder = BalanceRecorder(robot)
        watch = PickWatch(running, oracle, self.recorder, touches)
        goal = DisassembleGoal(1, self._docks, pick=PickGoal(self._label, side="either"))
        news, since = News(running.bus, topics.FEEDBACK), running.executor.t

        def look() -> None:
            nonlocal since
            watch()
            said = news.read()
            if said is not None and (said.skill == "dock" or said.stage == "detect"):
                since = running.executor.t

        result = running.execute("disassemble", goal, watch=look)
        running.executor.run(running.executor.t + SETTLE, watch.look)
        outcome = judge_pick(self._stack, result, oracle, watch, lost(running, watch.recorder))
        found = result.value if isinstance(result.value, DisassembleReport) else DisassembleReport()
        pick = found.picks[-1] if found.picks else PickReport()
        # The robot tells places in its own odom, which has drifted on the way.
        estimate = running.bus.latest(topics.BASE)
        T_base_odom = np.linalg.inv(robot.truth.base().T_world_base) @ oracle.T_world_odom
        T = np.linalg.inv(T_base_odom) if estimate is None else estimate.T_odom_base
        fasteners = [
            replace(f, position=_at(T @ T_base_odom, f.position), in_base=_at(T_base_odom, f.position)) for f in before
        ]
        looked_at = {i: _at(T @ T_base_odom, place) for i, place in watch.looked_at.items()}
        served = sum(load_map().serves(side, f.in_base) for f in fasteners if f.loose for side in SIDES)
        series = {
            **outcome.series,
            **balance(self.recorder.trace(running.executor.t - since)),
            **self._series,
            **self._placed("after"),
            **touches.series(),
            **claims(pick, fasteners, oracle.taken(before), bool(oracle.screws_in_tray()), looked_at),
            "dockings": float(len(found.docks)),
            "approaches": float(sum(dock.approaches for dock in found.docks)),
            "screws_served": float(served),
            "contacts": float(len(self._contacts.touched)),
        }
        outcome = replace(outcome, series=series)
        if outcome.success or outcome.stage in ("fall", "safety", "fault"):
            return outcome
        stands_badly = not served or pick.outcome in NOWHERE_TO_WORK
        return replace(outcome, stage="stance", module=self._who(found)) if stands_badly else outcome

    def _who(self, found: DisassembleReport) -> str | None:
        """Return the module that put the robot where no hand gets to a screw."""
        if found.docks:
            return "skill: dock"
        if self._spec.case["start"] == "placed":
            return None  # nobody: the robot was put there
        drift, off = (place_error(self._episode.running.bus, self._episode.robot), self._series["before_radial"])
        return self._name("mapper" if drift > 0.5 * off else "navigator")

    def _placed(self, when: str) -> dict[str, float]:
        return errors(when, self._stance.to(self._episode.robot.truth.pose()))

    def _failed(self, loss: Loss, slot: str) -> TrialOutcome:
        series = {**self._series, "contacts": float(len(self._contacts.touched))}
        return TrialOutcome(
            False, loss.stage, self._name(slot), loss.detail, series=series, picture=self._oracle.picture(),
            trace=loss.trace,
        )  # fmt: skip

    def _name(self, slot: str) -> str:
        return f"{slot}: {self._stack.choice(slot).use}"


def drawn_stance(spec: TrialSpec, walks: bool) -> PlanarPose:
    """Return where the robot should stand before the pack, from where it begins."""
    if walks:
        off = spec.rng("start").uniform(-1.0, 1.0, 3) * SPREAD
        return PlanarPose(DISTANCE + float(off[0]), float(off[1]), float(off[2]))
    x, y, turn = spec.rng("placement").standard_normal(3) * (*PLACEMENT, TURN)
    return PlanarPose(float(x), float(y), float(turn)).to(HERE)


def _at(T: Array, place: Array) -> Array:
    return T[:3, :3] @ place + T[:3, 3]
