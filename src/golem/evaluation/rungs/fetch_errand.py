"""Rung `fetch`: look at a counter, remember, and bring one thing along it, on the robot's own feet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from golem.evaluation.base import Case, Results, TrialSpec
from golem.evaluation.episodes.counter_watch import CounterWatch
from golem.evaluation.episodes.oracle import Oracle, place_error
from golem.evaluation.rungs.counter import counter_verdict, draw_errand
from golem.evaluation.rungs.kitchen_rung import Errand, KitchenRung, Verdict
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.worlds.conditions import LayoutKind
from golem.robots.worlds.kitchen import KitchenLayout
from golem.robots.worlds.tableware import KINDS
from golem.runtime.lockstep import LockstepRunner
from golem.skills.fetch import FetchGoal, FetchReport
from golem.skills.remember import RememberGoal

LOOK = RememberGoal(tuple(KINDS), 2.0)
"""The look at the counter before the errand."""


@dataclass(frozen=True)
class FetchOptions:
    """The kitchen."""

    layout: LayoutKind = "varied"
    """nominal: the counter always has one height and one colour. varied: drawn from the trial's seed."""
    moved: tuple[str, ...] = ("no", "yes")
    """no: the thing stays where it was seen. yes: somebody puts it elsewhere on the counter before the errand."""


class FetchRung(KitchenRung[FetchOptions]):
    """One errand per trial: a thing is recalled, gone to, taken, and set down at another place on the counter.

    It is judged as on the rung `counter-stand`; what it was asked for is in the frame of the robot's memory, which the
    robot's own errors of place belong to.
    """

    name = "fetch"
    Options = FetchOptions
    default_methods = ("object_map",)
    slot = "memory"
    balances = True
    stack_name = "errand"

    def cases(self, results: Results) -> Sequence[Case]:
        """Return whether the thing is moved meanwhile; see `Rung`."""
        return [{"moved": moved} for moved in self.options.moved]

    def errand(
        self, spec: TrialSpec, running: LockstepRunner, robot: MujocoRobot, kitchen: KitchenLayout, oracle: Oracle
    ) -> Errand:
        """Have one thing fetched; see `KitchenRung`."""
        kind, _, (x, y) = draw_errand(spec, kitchen)
        at = running.stack.choice("robot").options.get("stance", (0.0, 0.0, 0.0))
        place = x + float(at[0]), y + float(at[1])
        looked = running.execute("remember", LOOK)
        if spec.case.get("moved") == "yes":
            _move(robot, kitchen, kind, spec.rng("moved"))
        watch, result = CounterWatch(running, robot, oracle, kind, True), looked
        if looked.success:
            spot = np.linalg.inv(robot.truth.T_world_odom) @ (*place, 0.0, 1.0)
            goal = FetchGoal(kind, (float(spot[0]), float(spot[1])))
            result = running.execute("fetch", goal, watch=watch)
        found = result.value if isinstance(result.value, FetchReport) else FetchReport()
        ways = {"approaches": float(found.approaches), "places_looked": 0.5 * len(found.looked)}

        def judge() -> Verdict:
            seen, off = counter_verdict(watch, place), place_error(running.bus, robot)
            series = seen.series | ways | {"place_error": off}
            # Places are in the frame of the memory: a robot that errs about its own sets things down beside them.
            lost_its_way = off > 0.5 * series.get("set_down_error", math.inf)
            return replace(seen, series=series, slot="odometry" if lost_its_way else seen.slot)

        return Errand(result, watch, judge)


def _move(robot: MujocoRobot, kitchen: KitchenLayout, kind: str, rng: np.random.Generator) -> None:
    """Let the first thing of a kind and another one, which is drawn, change places."""
    things = kitchen.things
    one = next(thing for thing in things if thing.kind == kind)
    others = [thing for thing in things if thing is not one]
    other = others[int(rng.integers(len(others)))]
    data = robot.data
    a, b = (robot.scene.model.joint(thing.body).qposadr[0] for thing in (one, other))
    data.qpos[a : a + 2], data.qpos[b : b + 2] = data.qpos[b : b + 2].copy(), data.qpos[a : a + 2].copy()
    mujoco.mj_forward(robot.scene.model, data)
