"""Rung `errands`: 30 errands by words in kitchen and pack, done by the planner without a model, through the tools."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import mujoco
import numpy as np

from golem.agent.audit import AuditLog
from golem.agent.desk import Desk
from golem.agent.sentences import ErrandReport, SentencePlanner
from golem.agent.stack_body import StackBody
from golem.agent.tool_rules import Rules
from golem.errors import check_known
from golem.evaluation.base import DONE, Case, Results, TrialSpec
from golem.evaluation.episodes.counter_watch import LIFTED, CounterWatch, ErrandWatch
from golem.evaluation.episodes.oracle import Oracle, whereabouts
from golem.evaluation.rungs.counter import ACROSS, AREA, FREE, LOOK, TIGHT, radius
from golem.evaluation.rungs.kitchen_rung import Errand, KitchenOptions, KitchenRung, Verdict
from golem.evaluation.rungs.pick_screw import SLOT, doable
from golem.package_data import load_data
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.worlds.conditions import LayoutKind
from golem.robots.worlds.kitchen import KitchenLayout, StandingThing
from golem.runtime.lockstep import LockstepRunner
from golem.skills.base import SkillResult
from golem.skills.search import SearchGoal
from golem.stack import Stack, load_stack
from golem.types import SIDES, Array

SUITE: Mapping[str, Mapping[str, Any]] = load_data(__package__, "errands.yaml")
"""What is asked, by the name of the errand."""
RULES = Rules(default="free", calls=10**6)
SPOTS = 400
"""Places that are drawn for a thing that is put elsewhere; the one with the most room is taken."""
NEAR = 0.08
"""How far a place that was told may be off [m]."""
AWAY = 0.25
"""Least distance by which a thing is put elsewhere [m]: a memory takes what head cameras are off by for no move."""
BESIDE = (14, 16, 18, 20, 25, 30)
"""How far beside each other things are asked for [cm]."""


@dataclass(frozen=True)
class ErrandsOptions(KitchenOptions):
    """The worlds, and which errands."""

    layout: LayoutKind = "nominal"
    """nominal or varied; see the rungs `counter-tether` and `tether`."""
    errand: tuple[str, ...] = ()
    """Names of errands, such as k01; none: all."""


class Asked:
    """One errand in a kitchen: what is meant by its words, and where things stood at first."""

    def __init__(self, spec: TrialSpec, robot: MujocoRobot, kitchen: KitchenLayout, shift: Array) -> None:
        """Draw what is meant; the area that is reached is shifted by (2,) `shift` in the world [m]."""
        self.rng, self._robot, self._shift = spec.rng(f"errand {spec.case['errand']}"), robot, shift
        order = [kitchen.things[k] for k in self.rng.permutation(len(kitchen.things))]
        pairs = [(a, b) for a in order for b in order if a is not b]
        one_hand = ((a, b) for a, b in pairs if self._one_hand(self.at(a), self.at(b)))
        self.things, (self.a, self.b) = order, next(one_hand, pairs[0])
        self.cm, self.way, self.beside = BESIDE[-1], "left", self.at(self.b)
        for a, b, cm, sign in ((a, b, cm, s) for a, b in pairs for cm in BESIDE for s in (1, -1)):
            spot = self.at(b) + (0.0, 0.01 * sign * cm)
            if self._reached(spot) and self.room(spot, a) > FREE and self._one_hand(self.at(a), spot):
                self.pair, self.cm, self.way, self.beside = (a, b), cm, "left" if sign > 0 else "right", spot
                break
        else:
            self.pair = self.a, self.b
        self.first = {thing.body: self.at(thing) for thing in order}

    def at(self, thing: StandingThing) -> Array:
        """Return (2,) where a thing stands, in the world [m]."""
        return self._robot.data.body(thing.body).xpos[:2].copy()

    def _reached(self, spot: Array) -> bool:
        low, high = np.array(AREA).T
        return bool((low <= spot - self._shift).all() and (spot - self._shift <= high).all())

    def _one_hand(self, here: Array, there: Array) -> bool:
        """Return whether the hand on the side of (2,) `here` is asked to go as far as (2,) `there`."""
        return math.copysign(1.0, here[1] - self._shift[1]) * float(there[1] - self._shift[1]) > -ACROSS

    def room(self, spot: Array, one: StandingThing) -> float:
        """Return how much room a thing would have at (2,) `spot` beside the others [m]."""
        others = [each for each in self.things if each is not one]
        return min(float(np.linalg.norm(self.at(o) - spot)) - radius(o) - radius(one) for o in others)

    def away(self, one: StandingThing) -> None:
        """Put a thing where the most room is, also from where it and the others stood at first."""
        low, high = np.array(AREA).T
        spots = self.rng.uniform(low, high, (SPOTS, 2)) + self._shift
        widest, origin = 2.0 * max(radius(each) for each in self.things), self.first[one.body]

        def fit(spot: Array) -> float:
            if not self._one_hand(spot, origin) or self.room(spot, one) < TIGHT:
                return -math.inf
            left = min(float(np.linalg.norm(spot - at)) for at in self.first.values()) - widest
            return min(self.room(spot, one), left, float(np.linalg.norm(spot - origin)) - AWAY, FREE)

        joint = self._robot.scene.model.joint(one.body).qposadr[0]
        self._robot.data.qpos[joint : joint + 2] = max(spots, key=fit)
        mujoco.mj_forward(self._robot.scene.model, self._robot.data)


class ErrandsRung(KitchenRung[ErrandsOptions]):
    """One errand per trial and case, said in words, and judged by the simulator's truth."""

    name = "errands"
    Options = ErrandsOptions
    default_methods = ("object_map",)
    default_n = 1
    slot = "memory"
    subject = "kitchen or pack"
    stack_name = "counter-tether"

    def suits(self, robot: MujocoRobot) -> bool:
        return True

    def cases(self, results: Results) -> Sequence[Case]:
        check_known("errand", SUITE, *self.options.errand)
        return [{"errand": name} for name in self.options.errand or SUITE]

    def arranged(self, spec: TrialSpec, stack: Stack) -> Stack:
        own = SUITE[str(spec.case["errand"])].get("stack")
        if own is None:
            return stack
        chosen = load_stack(own, profile=spec.profile).with_options("robot", layout=self.options.layout)
        return replace(chosen, choices={**chosen.choices, "memory": stack.choice("memory")})

    def errand(
        self, spec: TrialSpec, running: LockstepRunner, robot: MujocoRobot, kitchen: KitchenLayout, oracle: Oracle
    ) -> Errand:
        said = SUITE[str(spec.case["errand"])]
        if robot.scene.kitchen is None:
            return self._screws(said, running, robot, oracle)
        stance = running.stack.choice("robot").options.get("stance", (0.0, 0.0, 0.0))
        asked = Asked(spec, robot, kitchen, np.array(stance[:2], float))
        judged: Mapping[str, str] = said["judge"]
        if judged.get("at") == "beside":
            asked.a, asked.b = asked.pair
        for step in said.get("before", ()):
            if step == "look":
                running.execute("remember", LOOK)
            elif "find" in step:
                running.execute("search", SearchGoal(getattr(asked, step["find"]).kind))
            elif "away" in step:
                asked.away(getattr(asked, step["away"]))
            else:
                running.sleep(step["sleep"])
        if judged.get("at") == "beside":
            asked.beside = asked.at(asked.b) + (0.0, 0.01 * asked.cm * (1 if asked.way == "left" else -1))
        a = asked.a
        words = said["words"].format(a=a.kind, b=asked.b.kind, cm=asked.cm, way=asked.way)
        watch = CounterWatch(running, robot, oracle, a.kind, running.stack.on_ground)
        before, count = robot.data.body(a.body).xpos[2], sum(one.kind == a.kind for one in asked.things)
        report, result = self._done(words, running, robot, watch)

        def judge() -> Verdict:
            slot = "localizer" if "count" in judged else "memory" if "told" in judged else SLOT
            if "count" in judged:
                fine, why = report.facts.get("count") == count, f"There are {count}."
            elif "held" in judged:
                height = float(robot.data.body(a.body).xpos[2] - before)
                fine, why = height > LIFTED, f"The {a.kind} is {1e2 * height:.0f} cm higher than it was."
            elif "told" in judged:
                there = asked.at(a) if judged["told"] == "now" else asked.first[a.body]
                off = math.dist(_in_world(running, robot, report.facts.get("place")), there)
                fine, why = off < NEAR, f"The place that was said is {1e2 * off:.0f} cm off."
            else:
                place = asked.beside if judged["at"] == "beside" else asked.first[getattr(asked, judged["at"]).body]
                spot = float(place[0]), float(place[1])
                problem = watch.problem(spot)
                fine, why = problem is None, problem or ""
                # A hand that sets a thing down where the robot meant to is not to blame for what it remembers.
                if watch.astray(spot) and math.dist(_in_world(running, robot, report.facts.get("place")), spot) > NEAR:
                    slot = "memory"
            return Verdict(fine, f"'{words}': {report.text} {why}", {}, slot)

        return Errand(result, watch, judge)

    def _screws(self, said: Mapping[str, Any], running: LockstepRunner, robot: MujocoRobot, oracle: Oracle) -> Errand:
        """Have screws taken out; what was told of tight ones has to be so."""
        fasteners, drops = oracle.fasteners(), oracle.drop_places()
        able = [f for f in fasteners if f.loose and doable([f], drops)]
        sides = {side: [f for f in able if (f.in_base[1] > 0.0) == (side == "left")] for side in SIDES}
        side = max(sides, key=lambda name: len(sides[name]))
        words = said["words"].format(n=len(sides[side]), side=side)
        wanted = said["judge"]["screws"] or len(sides[side])
        report, result = self._done(words, running, robot, None)

        def judge() -> Verdict:
            out = sum(one.where == "tray" for one in whereabouts(robot))
            heads = np.array([f.position[:2] for f in fasteners])
            told = [fasteners[int(np.linalg.norm(heads - at, axis=1).argmin())] for at in report.facts.get("tight", [])]
            wrong = sum(f.loose for f in told)
            why = (
                f"'{words}': {report.text} {out} of {wanted} are in the tray, {wrong} that were called tight are loose."
            )
            return Verdict(out >= wanted and not wrong, why, {"in_tray": float(out), "wrongly_tight": float(wrong)})

        return Errand(result, ErrandWatch(running, oracle, None), judge)

    def _done(
        self, words: str, running: LockstepRunner, robot: MujocoRobot, watch: CounterWatch | None
    ) -> tuple[ErrandReport, SkillResult]:
        """Have the planner do what the words say; return what it reports, as a result too."""
        start = running.executor.t
        with TemporaryDirectory() as folder, closing(AuditLog(Path(folder) / "audit.jsonl")) as log:
            desk = Desk(StackBody(running, robot, watch=watch), RULES, log)
            report = SentencePlanner(desk.call).do(words)
        timings = {"total": running.executor.t - start}
        stage, slot = (DONE, None) if report.done else (report.stage, report.slot)
        return report, SkillResult(report.done, stage, slot, report.text, timings)


def _in_world(running: LockstepRunner, robot: MujocoRobot, place: Sequence[float] | None) -> tuple[float, float]:
    """Return a place of the memory's frame in the world [m]; far away where there is none."""
    there = None if place is None else StackBody(running, robot).in_odom("memory", *place[:2])
    if there is None:
        return math.inf, math.inf
    x, y = (robot.truth.T_world_odom @ (*there, 0.0, 1.0))[:2].tolist()
    return x, y
