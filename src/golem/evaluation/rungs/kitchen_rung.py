"""What the rungs in a kitchen share: their stack, the course of a trial, and which module lost it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

from golem.errors import ConfigError
from golem.evaluation.base import DONE, Rung, TrialOutcome, TrialSpec
from golem.evaluation.blame.oracles import with_modules
from golem.evaluation.episodes.counter_watch import ErrandWatch
from golem.evaluation.episodes.episode import episode_seed, lost
from golem.evaluation.episodes.oracle import Oracle
from golem.evaluation.rungs.calibrated_robot import calibrated
from golem.evaluation.rungs.pick_screw import ABORTED, SLOT, balance, let_go
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.gl import shared_context
from golem.robots.worlds.conditions import LayoutKind
from golem.robots.worlds.kitchen import KitchenLayout
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.slots import KEYS
from golem.stack import Stack, load_stack

SETTLE = 1.0
"""Robot time that doors and things get to come to rest [s]."""


@dataclass(frozen=True)
class KitchenOptions:
    """The kitchen."""

    layout: LayoutKind = "varied"
    """nominal: the counter always has one height and one colour, and the fridge one place, from which it opens to the
    right. varied: places, sizes, colours and the side of the hinge are drawn from the trial's seed."""
    calibrated: str = ""
    """Folder of calibrations; see the rung `pack`."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is so at the end of an errand, by the simulator's truth.

    Attributes:
        done: whether it is as it was asked for.
        words: what is not, in a sentence.
        slot: what is to blame where the robot says that it is done, and it is not.
    """

    done: bool
    words: str
    series: dict[str, float]
    slot: str = SLOT


@dataclass(frozen=True, slots=True)
class Errand:
    """An errand that has ended."""

    result: SkillResult
    watch: ErrandWatch
    judge: Callable[[], Verdict]


O = TypeVar("O", bound=KitchenOptions)  # noqa: E741 - the options


class KitchenRung(Rung[O]):
    """One errand in a kitchen per trial.

    Attributes:
        subject: what the twin has to have, in the words of an error.
        stack_name: the shipped stack that it runs; empty for the one of its own name.
        balances: whether the robot stands on its own feet.
    """

    Options = KitchenOptions
    slot: ClassVar[str] = SLOT
    subject: ClassVar[str] = "kitchen"
    stack_name: ClassVar[str] = ""
    balances = False

    @abstractmethod
    def errand(
        self, spec: TrialSpec, running: LockstepRunner, robot: MujocoRobot, kitchen: KitchenLayout, oracle: Oracle
    ) -> Errand:
        """Have the errand of a trial done by a robot that stands or hangs ready."""

    def suits(self, robot: MujocoRobot) -> bool:
        """Return whether a twin has what the rung is about."""
        return robot.scene.kitchen is not None

    def arranged(self, spec: TrialSpec, stack: Stack) -> Stack:
        """Return `stack` with the world as a trial needs it."""
        return stack

    def stack_of(self, spec: TrialSpec) -> Stack:
        """Return the stack of a trial, whose robot was calibrated first where that is asked for."""
        stack = self.arranged(spec, self.make_stack(spec.method, spec.profile, spec.overrides))
        keep = self.options.calibrated
        return calibrated(stack, episode_seed(spec.seed, spec.index), keep) if keep else stack

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        stack = self.make_stack(method, profile, overrides)
        shared_context()
        return stack_facts(stack)

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        stack = self.stack_of(spec)
        running, robot = build(stack, episode_seed(spec.seed, spec.index))
        if not isinstance(robot, MujocoRobot) or not self.suits(robot):
            raise ConfigError(
                f"Rung {self.name} judges the twin's {self.subject}; robot: {stack.choice('robot').use} is none."
            )
        if self.onlooker is not None:
            self.onlooker(running, robot)
        with closing(robot), closing(Oracle(robot)) as oracle:
            hangs = let_go(running, robot) if stack.on_ground else None
            if hangs is not None:
                return hangs
            errand = self.errand(spec, running, robot, cast(KitchenLayout, robot.scene.kitchen), oracle)
            running.executor.run(running.executor.t + SETTLE, errand.watch.look, due=errand.watch.due)
            recorder = errand.watch.recorder
            if artefacts is not None and recorder is not None:
                recorder.trace().save(artefacts / TRACE)
            return self._judge(stack, running, errand)

    def _judge(self, stack: Stack, running: LockstepRunner, errand: Errand) -> TrialOutcome:
        """Say whether it is as it was asked for and the robot still there, and if not, which module lost it."""
        result, watch, verdict = errand.result, errand.watch, errand.judge()
        series = verdict.series
        if watch.recorder is not None:
            series |= balance(watch.recorder.trace())
        picture, timings = watch.last_picture(), result.timings
        loss = lost(running, watch.recorder)
        if loss is not None and result.stage not in ABORTED:
            module = f"lower_body: {stack.choice('lower_body').use}" if stack.on_ground else None
            detail = f"{loss.detail} The errand itself: {result.reason}"
            return TrialOutcome(False, loss.stage, module, detail, timings, series, picture, loss.trace)
        if verdict.done and result.stage not in ABORTED:
            return TrialOutcome(True, DONE, None, result.reason, timings, series, picture)
        stage = result.stage if result.stage != DONE else "release"
        slot = result.slot if result.stage != DONE else verdict.slot
        module = None if slot is None else f"{slot}: {stack.choice(slot).use}" if slot in KEYS else slot
        detail = f"{result.reason} {verdict.words}".strip()
        return TrialOutcome(False, stage, module, detail, timings, series, picture, result.trace)

    def make_stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        """Return the stack of a trial. Raises ConfigError: an override replaces what the rung compares, or is none."""
        if self.slot in overrides or "robot" in overrides:
            raise ConfigError(
                f"The method is what sits in {self.slot}, and the {self.subject} is the rung's; leave out --use "
                f"{self.slot}=... and --use robot=..."
            )
        stack = load_stack(self.stack_name or self.name, profile=profile).with_choice(self.slot, method)
        stack = stack.with_options("robot", layout=self.options.layout)
        return with_modules(stack, overrides)
