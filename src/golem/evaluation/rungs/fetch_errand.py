"""Rung `fetch`: look at a counter, remember, and bring one thing along it, on the robot's own feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from golem import registry
from golem.errors import ConfigError
from golem.evaluation.base import DONE, Case, Results, Rung, TrialOutcome, TrialSpec
from golem.evaluation.episodes.counter_watch import CounterWatch
from golem.evaluation.episodes.episode import episode_seed, lost
from golem.evaluation.episodes.oracle import Oracle
from golem.evaluation.rungs.counter import draw_errand
from golem.evaluation.rungs.pick_screw import ABORTED, balance, let_go
from golem.provenance import stack_facts
from golem.robots.mujoco.balance import TRACE
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.gl import shared_context
from golem.robots.worlds.conditions import LayoutKind
from golem.robots.worlds.tableware import KINDS
from golem.runtime.lockstep import LockstepRunner, build
from golem.skills.base import SkillResult
from golem.skills.fetch import FetchGoal, FetchReport
from golem.skills.remember import RememberGoal
from golem.slots import KEYS
from golem.stack import Stack, load_stack

MEMORY, STACK = "memory", "errand"
LOOK = RememberGoal(tuple(KINDS), 2.0)
"""The look at the counter before the errand."""
SETTLE = 1.0
"""Robot time that what was set down gets to come to rest [s]."""


@dataclass(frozen=True)
class FetchOptions:
    """The kitchen."""

    layout: LayoutKind = "varied"
    """nominal: the counter always has one height and one colour. varied: drawn from the trial's seed."""
    moved: tuple[str, ...] = ("no", "yes")
    """no: the thing stays where it was seen. yes: somebody puts it elsewhere on the counter before the errand."""


class FetchRung(Rung[FetchOptions]):
    """One errand per trial: a thing is recalled, gone to, taken, and set down at another place on the counter.

    It is judged as on the rung `counter-stand`; what it was asked for is in the frame of the robot's memory, which the
    robot's own errors of place belong to.
    """

    name = "fetch"
    Options = FetchOptions
    default_methods = ("object_map",)

    def methods(self) -> tuple[str, ...]:
        """Return the registered memories."""
        return registry.names(MEMORY)

    def cases(self, results: Results) -> Sequence[Case]:
        """Return whether the thing is moved meanwhile; see `Rung`."""
        return [{"moved": moved} for moved in self.options.moved]

    def config(self, method: str, profile: str, overrides: Mapping[str, str]) -> Mapping[str, Any]:
        """Return what determines a trial besides its seed; see `Rung`."""
        stack = self._stack(method, profile, overrides)
        for key, row in KEYS.items():
            registry.load(row.slot, stack.choice(key).use)
        shared_context()
        return stack_facts(stack)

    def run(self, spec: TrialSpec, artefacts: Path | None) -> TrialOutcome:
        """Run one trial; see `Rung`."""
        stack = self._stack(spec.method, spec.profile, spec.overrides)
        running, robot = build(stack, episode_seed(spec.seed, spec.index))
        if not isinstance(robot, MujocoRobot) or robot.scene.kitchen is None:
            raise ConfigError(
                f"Rung {self.name} judges the twin's counter; robot: {stack.choice('robot').use} is none."
            )
        if self.onlooker is not None:
            self.onlooker(running, robot)
        with closing(robot), closing(Oracle(robot)) as oracle:
            hangs = let_go(running, robot)
            if hangs is not None:
                return hangs
            asked = draw_errand(spec, robot.scene.kitchen)
            if asked is None:
                raise ConfigError(f"The counter of trial {spec.index} has no room for an errand.")
            kind, _, (x, y) = asked
            x, y = x + self._at(stack)[0], y + self._at(stack)[1]
            looked = running.execute("remember", LOOK)
            if spec.case.get("moved") == "yes":
                _move(robot, kind, spec.rng("moved"))
            watch = CounterWatch(running, robot, oracle, kind, True)
            result = looked
            if looked.success:
                spot = np.linalg.inv(robot.truth.T_world_odom) @ (x, y, 0.0, 1.0)
                result = running.execute(
                    "fetch", FetchGoal(kind, (float(spot[0]), float(spot[1]))), watch=watch
                )
            running.executor.run(running.executor.t + SETTLE, watch.look)
            if artefacts is not None and watch.recorder is not None:
                watch.recorder.trace().save(artefacts / TRACE)
            return self._judge(stack, running, result, watch, (x, y))

    def _judge(
        self,
        stack: Stack,
        running: LockstepRunner,
        result: SkillResult,
        watch: CounterWatch,
        place: tuple[float, float],
    ) -> TrialOutcome:
        """Say whether it stands where it was asked for and the rest where it was, and if not, which module lost it."""
        found = result.value if isinstance(result.value, FetchReport) else FetchReport()
        series = watch.series(place)
        series |= {"approaches": float(found.approaches), "places_looked": 0.5 * len(found.looked)}
        if watch.recorder is not None:
            series |= balance(watch.recorder.trace())
        picture, timings = watch.last_picture(), result.timings
        loss, problem = lost(running, watch.recorder), watch.problem(place)
        if loss is not None and result.stage not in ABORTED:
            legs = f"lower_body: {stack.choice('lower_body').use}"
            detail = f"{loss.detail} The errand itself: {result.reason}"
            return TrialOutcome(False, loss.stage, legs, detail, timings, series, picture, loss.trace)
        if problem is None and result.stage not in ABORTED:
            return TrialOutcome(True, DONE, None, result.reason, timings, series, picture)
        stage = result.stage if result.stage != DONE else "release"
        slot = result.slot if result.stage != DONE else "odometry"
        module = None if slot is None else f"{slot}: {stack.choice(slot).use}" if slot in KEYS else slot
        detail = f"{result.reason} {problem or ''}".strip()
        return TrialOutcome(False, stage, module, detail, timings, series, picture, result.trace)

    def _at(self, stack: Stack) -> tuple[float, float]:
        """Return x, y of where the robot should stand, in the world [m]."""
        stance = stack.choice("robot").options.get("stance", (0.0, 0.0, 0.0))
        return float(stance[0]), float(stance[1])

    def _stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        if MEMORY in overrides or "robot" in overrides:
            raise ConfigError(
                f"The method is what sits in {MEMORY}, and the kitchen is the rung's; leave out --use {MEMORY}=... "
                "and --use robot=..."
            )
        stack = load_stack(STACK, profile=profile).with_choice(MEMORY, method)
        stack = stack.with_options("robot", layout=self.options.layout)
        for slot, use in overrides.items():
            stack = stack.with_choice(slot, use)
        return stack


def _move(robot: MujocoRobot, kind: str, rng: np.random.Generator) -> None:
    """Let the first thing of a kind and another one, which is drawn, change places."""
    assert robot.scene.kitchen is not None
    things = robot.scene.kitchen.things
    one = next(thing for thing in things if thing.kind == kind)
    others = [thing for thing in things if thing is not one]
    other = others[int(rng.integers(len(others)))]
    data = robot.data
    a, b = (robot.scene.model.joint(thing.body).qposadr[0] for thing in (one, other))
    data.qpos[a : a + 2], data.qpos[b : b + 2] = data.qpos[b : b + 2].copy(), data.qpos[a : a + 2].copy()
    mujoco.mj_forward(robot.scene.model, data)
