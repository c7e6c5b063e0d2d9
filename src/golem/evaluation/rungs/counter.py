"""Rungs `counter-tether`, `counter-stand` and `fetch`: take a thing from a counter, and set it down where asked.

Both run the same trials: trial `i` of one seed has the same counter, thing, hand, place, calibration errors and noise
on either rung.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import mujoco
import numpy as np

from golem import registry
from golem.errors import ConfigError, check_known
from golem.evaluation.base import Case, Results, TrialSpec
from golem.evaluation.episodes.counter_watch import CounterWatch
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.episodes.oracle import Oracle, place_error
from golem.evaluation.rungs.kitchen_rung import Errand, KitchenOptions, KitchenRung, Verdict
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.scene import lay_kitchen
from golem.robots.worlds.kitchen import KitchenLayout, StandingThing
from golem.robots.worlds.tableware import KINDS
from golem.runtime.lockstep import LockstepRunner
from golem.skills.base import SkillResult
from golem.skills.fetch import FetchGoal, FetchReport
from golem.skills.place import PlaceGoal
from golem.skills.remember import RememberGoal
from golem.skills.take_config import TakeGoal, TakeReport
from golem.stack import Stack
from golem.types import Side

AREA = ((0.43, 0.56), (-0.38, 0.38))
"""x and y bounds in base_link of the places that are asked for [m]: the hand on their side gets there."""
FREE = 0.045
"""Room between what stands at such a place and other things that is enough [m]."""
TIGHT = 0.015
"""Room with which it still can be set down, and less than which is not asked for [m]."""
EAR = 0.03
"""How far a mug's ear is beyond its radius [m]."""
ELSEWHERE = 0.10
"""Least distance of it from where the thing stood [m]."""
SUPPORT = 0.02
"""Surface that is left between what stands at such a place and the counter's front edge [m]."""
ACROSS = 0.06
"""How far beyond the middle of the robot a hand is asked to go [m]."""


@dataclass(frozen=True)
class CounterOptions(KitchenOptions):
    """The counter and what is asked."""

    approach: Literal["top", "forward", "either"] = "either"
    """How the hand is to come."""
    thing: tuple[str, ...] = ()
    """Kinds that are asked for, case by case, each with the hand on its side; else the trial's seed draws one."""
    sizes: float = 0.0
    """How much larger or smaller than its kind a thing is at most, as a share, drawn from the trial's seed."""
    each: bool = False
    """Whether every kind of thing is tried with each hand, case by case; else the trial's seed draws both.
    Where the thing stands on the other side, the counter is mirrored."""


class CounterRung(KitchenRung[CounterOptions]):
    """One thing per trial: taken from the counter by its name, lifted, and set down at another place.

    It succeeds where such a thing was lifted by 5 cm, stands upright within 6 cm of the place, and nothing else has
    been moved by more than 5 cm or knocked over.
    """

    Options = CounterOptions
    default_methods = ("centroid", "antipodal", "reranked")
    subject = "counter"

    def make_stack(self, method: str, profile: str, overrides: Mapping[str, str]) -> Stack:
        stack = super().make_stack(method, profile, overrides)
        return stack.with_options("robot", sizes=self.options.sizes) if self.options.sizes else stack

    def cases(self, results: Results) -> Sequence[Case]:
        kinds = self.options.thing
        check_known("thing", KINDS, *kinds)
        if not self.options.each:
            return [{"thing": kind} for kind in kinds] or ({},)
        return [{"thing": kind, "hand": hand} for kind in kinds or KINDS for hand in ("left", "right")]

    def arranged(self, spec: TrialSpec, stack: Stack) -> Stack:
        choice = stack.choice("robot")
        config = registry.configure("robot", choice.use, choice.options)
        kitchen = lay_kitchen(config, episode_seed(spec.seed, spec.index))
        return stack.with_options("robot", mirrored=True) if self.mirrored(spec, kitchen) else stack

    def mirrored(self, spec: TrialSpec, kitchen: KitchenLayout) -> bool:
        """Return whether the thing of a case stands where its hand is not asked to go."""
        kind, hand = spec.case.get("thing"), spec.case.get("hand")
        sign = 1.0 if hand == "left" else -1.0
        return hand is not None and any(sign * t.position[1] < -ACROSS for t in kitchen.things if t.kind == kind)

    def errand(
        self, spec: TrialSpec, running: LockstepRunner, robot: MujocoRobot, kitchen: KitchenLayout, oracle: Oracle
    ) -> Errand:
        kind, hand, place = draw_errand(spec, kitchen)
        watch = CounterWatch(running, robot, oracle, kind, self.balances)
        result = self._errand(running, robot, watch, TakeGoal(kind, hand, self.options.approach), place)
        return Errand(result, watch, lambda: counter_verdict(watch, place))

    def _errand(
        self, running: LockstepRunner, robot: MujocoRobot, watch: CounterWatch, goal: TakeGoal, at: tuple[float, float]
    ) -> SkillResult:
        taken = running.execute("take", goal, watch=watch)
        if not taken.success:
            return taken
        found = taken.value if isinstance(taken.value, TakeReport) else TakeReport()
        spot = np.linalg.inv(robot.truth.T_world_odom) @ (*at, 0.0, 1.0)
        side: Side = "left" if found.side == "left" else "right"
        aside, off = (found.aside_x, found.aside_y), (found.off_x, found.off_y)
        x, y = float(spot[0]), float(spot[1])
        there = PlaceGoal(x, y, "odom", side, found.below, found.above, aside, off, found.radius)
        placed = running.execute("place", there, watch=watch)
        timings = {
            "detect_to_grasp": taken.timings.get("detect_to_grasp", 0.0),
            "total": taken.timings.get("total", 0.0) + placed.timings.get("total", 0.0),
        }
        return replace(placed, timings=timings)


class CounterTether(CounterRung):
    """Take a thing from a counter and set it down while the robot hangs in its hoist."""

    name = "counter-tether"


class CounterStand(CounterRung):
    """Take a thing from a counter and set it down while the robot balances on its own legs."""

    name = "counter-stand"
    balances = True


def counter_verdict(watch: CounterWatch, place: tuple[float, float]) -> Verdict:
    """Return whether the thing stands at `place`, x, y in the world [m], and the rest where it was."""
    problem = watch.problem(place)
    return Verdict(problem is None, problem or "", watch.series(place))


def draw_errand(spec: TrialSpec, kitchen: KitchenLayout) -> tuple[str, Literal["left", "right"], tuple[float, float]]:
    """Return the kind of a thing, the hand, and x, y of a free place for it in the world [m].

    The case names thing and hand where there is one. Else a thing and the hand on its side are drawn. Of the things
    that may be meant, the first is taken for which there is a place with room; where there is room for none, the last
    one is to be set down again where it stood. Raises ConfigError: nothing of the kind stands there.
    """
    rng = spec.rng("errand")
    things = kitchen.things
    order = rng.permutation(len(things))
    wanted = str(spec.case.get("thing", ""))
    back: tuple[str, Side, tuple[float, float]] | None = None
    spots = rng.uniform((AREA[0][0], AREA[1][0]), (AREA[0][1], AREA[1][1]), (200, 2))
    for chosen in (things[k] for k in order if wanted in ("", things[k].kind)):
        own: Side = "left" if chosen.position[1] > 0.0 else "right"
        hand: Side = "left" if spec.case.get("hand", own) == "left" else "right"
        mirror = 1.0 if hand == "left" else -1.0
        others = [thing for thing in things if thing is not chosen]
        wide = np.array([radius(thing) + radius(chosen) for thing in others])
        there = np.array([thing.position[:2] for thing in others]).reshape(-1, 2)
        deep = spots[:, 0] > kitchen.counter_front + radius(chosen) + SUPPORT
        free = spots[deep & (mirror * spots[:, 1] > -ACROSS)]
        room = (np.linalg.norm(free[:, None] - there, axis=2) - wide).min(axis=1, initial=np.inf)
        room[np.linalg.norm(free - chosen.position[:2], axis=1) < ELSEWHERE] = 0.0
        if room.max() >= TIGHT:
            # Any free place; of a counter without one the place with the most room.
            x, y = free[int(np.argmax(np.minimum(room, FREE)))]
            return chosen.kind, hand, (float(x), float(y))
        back = chosen.kind, hand, (float(chosen.position[0]), float(chosen.position[1]))
    if back is None:
        raise ConfigError(f"No {wanted} stands on the counter of trial {spec.index}.")
    return back


def radius(thing: StandingThing) -> float:
    """Return the room that a thing takes, its ear included [m]."""
    return thing.size * (KINDS[thing.kind][0] + (EAR if thing.kind == "mug" else 0.0))


LOOK = RememberGoal(tuple(KINDS), 2.0)
"""The look at the counter before the errand."""


@dataclass(frozen=True)
class FetchOptions(KitchenOptions):
    """The kitchen."""

    moved: tuple[str, ...] = ("no", "yes")
    """no: the thing stays where it was seen. yes: somebody puts it elsewhere on the counter before the errand."""


class FetchRung(KitchenRung[FetchOptions]):
    """One errand per trial: a thing is recalled, gone to, taken, and set down at another place on the counter.

    It is judged as on the rung `counter-stand`; what it was asked for is in the frame of the robot's memory, which the
    robot's own errors of place belong to.
    """

    name = "fetch"
    varied = {"moved": "moved"}
    Options = FetchOptions
    default_methods = ("object_map",)
    slot = "memory"
    balances = True
    stack_name = "errand"

    def errand(
        self, spec: TrialSpec, running: LockstepRunner, robot: MujocoRobot, kitchen: KitchenLayout, oracle: Oracle
    ) -> Errand:
        kind, (x, y), after = draw_fetch(spec, kitchen)
        at = running.stack.choice("robot").options.get("stance", (0.0, 0.0, 0.0))
        place = x + float(at[0]), y + float(at[1])
        looked = running.execute("remember", LOOK)
        if after is not kitchen:
            _move(robot, kitchen, after)
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
            # Places are in the frame of the memory: a robot that errs about its own sets things down beside them. What
            # fell, leans or lies on the floor was lost by the grasp, however far from its place.
            lost_its_way = watch.astray(place) and off > 0.5 * series.get("set_down_error", math.inf)
            return replace(seen, series=series, slot="odometry" if lost_its_way else seen.slot)

        return Errand(result, watch, judge)


def draw_fetch(spec: TrialSpec, kitchen: KitchenLayout) -> tuple[str, tuple[float, float], KitchenLayout]:
    """Return the kind of a thing, x, y of a place that is free for it, and the kitchen as it is by then.

    Where the case says that it is moved meanwhile, it and another one, which is drawn, have changed places.
    """
    kind, _, place = draw_errand(spec, kitchen)
    if spec.case.get("moved") != "yes":
        return kind, place, kitchen
    things, rng = list(kitchen.things), spec.rng("moved")
    one = next(k for k, thing in enumerate(things) if thing.kind == kind)
    other = [k for k in range(len(things)) if k != one][int(rng.integers(len(things) - 1))]
    a, b = things[one], things[other]
    things[one] = replace(a, position=(*b.position[:2], a.position[2]))
    things[other] = replace(b, position=(*a.position[:2], b.position[2]))
    after = replace(kitchen, things=tuple(things))
    _, _, place = draw_errand(replace(spec, case={**spec.case, "thing": kind}), after)
    return kind, place, after


def _move(robot: MujocoRobot, before: KitchenLayout, after: KitchenLayout) -> None:
    """Put things that stand elsewhere `after` than `before` there, each as much as it was moved."""
    model, data = robot.scene.model, robot.data
    for a, b in zip(before.things, after.things, strict=True):
        address = model.joint(a.body).qposadr[0]
        data.qpos[address : address + 2] += np.subtract(b.position[:2], a.position[:2])
    mujoco.mj_forward(model, data)
