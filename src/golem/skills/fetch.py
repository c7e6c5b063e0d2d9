"""Fetch: bring a thing by its name: recall where it is, go there, take it, carry it to a place and set it down."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Literal

import numpy as np

from golem.capabilities.navigation.edge_fit import NearEdge
from golem.capabilities.navigation.goto import GoTo
from golem.capabilities.planning.base import PlanRefused
from golem.errors import ConfigError
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.dock import APPROACH, approach
from golem.skills.force_guard import PATIENCE, KeptGrip
from golem.skills.navigate import NavigateGoal
from golem.skills.pack_view import see_edge
from golem.skills.place import HANDS, PlaceGoal
from golem.skills.pose_goal import FIRST_REPORT
from golem.skills.poses import head_off, lifted
from golem.skills.recall import RecalledPlace, RecalledPlaces, ask
from golem.skills.remember import RememberGoal
from golem.skills.take_config import TakeGoal, TakeReport
from golem.types import Array, PlanarPose, Side, Twist

STANDOFF = (0.35, 0.46)
"""Distances of base_link from the edge that belly and legs leave [m]."""
AHEAD = 0.50
"""Distance ahead at which the hands work best [m]."""
BESIDE = 0.16
"""How far beside the middle of the robot a place is best for a hand [m]."""
GOOD = (0.05, 0.12)
"""Distance and turn from the stance at which the robot may stay [m, rad]: a hand reaches that much further."""
SETTLE = 1.0
"""Time that the body gets to come to rest before it looks [s]."""
APPROACHES = 4
"""How often it is tried to come nearer."""
BACK = 0.35
"""How far it steps back from a counter before it walks elsewhere [m]: the arms come clear of what stands there."""
BLIND = 0.60
"""Distance from a place at which a robot stands that finds no edge [m]."""


async def stand_before(context: Context, place: Array, side: Side | None = None) -> int:
    """Bring the robot before a place on a counter that is at most two metres away; returns how often it moved.

    Args:
        context: of the skill; its legs walk, and its stack listens to a LiDAR.
        place: (2,) or (3,) in odom [m].
        side: the hand that is to get there; None: either.

    Raises:
        StageFailed: there is no edge, or no scan of it.
    """
    navigator, moved = GoTo(APPROACH), 0
    while True:
        context.legs.drive(Twist())
        await context.sleep(SETTLE)
        left = stance(await see_edge(context), PlanarPose.of(context.legs.pose), place, side)
        off = math.hypot(left.x, left.y)
        context.say("dock", f"{100 * off:.0f} cm and {math.degrees(left.yaw):.0f} deg from the stance.")
        if (off < GOOD[0] and abs(left.yaw) < GOOD[1]) or moved == APPROACHES:
            return moved
        await approach(context, navigator, PlanarPose.of(context.legs.pose) @ left)
        moved += 1


def stance(edge: NearEdge, here: PlanarPose, place: Array, side: Side | None = None) -> PlanarPose:
    """Return where to stand, as seen from the robot.

    Args:
        edge: of the counter, as seen from the robot.
        here: where the robot is in odom.
        place: (2,) or (3,) what a hand is to get to, in odom [m].
        side: that hand; None: either.
    """
    across = edge.pose.to(here.to(PlanarPose(float(place[0]), float(place[1]), 0.0)))
    standoff = float(np.clip(AHEAD - across.x, *STANDOFF))
    # By either hand: on the side on which the robot is already.
    aside = float(np.clip(edge.pose.to(PlanarPose(0.0, 0.0, 0.0)).y - across.y, -BESIDE, BESIDE))
    aside = aside if side is None else BESIDE if side == "right" else -BESIDE
    return edge.pose @ PlanarPose(-standoff, across.y + aside, 0.0)


async def step_back(context: Context) -> None:
    """Step back from the counter, straight."""
    await approach(context, GoTo(APPROACH), PlanarPose.of(context.legs.pose) @ PlanarPose(-BACK, 0.0, 0.0))


def before(here: PlanarPose, place: Array, distance: float) -> PlanarPose:
    """Return the pose at `distance` [m] before `place` (2,) or (3,) that faces it, all in one frame with `here`."""
    yaw = math.atan2(float(place[1]) - here.y, float(place[0]) - here.x)
    return PlanarPose(float(place[0]) - distance * math.cos(yaw), float(place[1]) - distance * math.sin(yaw), yaw)


NEAR = 1.3
"""Distance from a place within which the last steps go by the counter's edge [m]."""
STAGE, CARRYING = 0.85, 1.1
"""Distance from a place to which the navigator goes, and with an arm before the robot that holds something [m]."""
SAME = 0.25
"""Places nearer than this to each other are looked at from one stance [m]."""
ASIDE = 0.6
"""How far to either side along the counter it is searched for [m]."""
RAISES = (0.25, 0.20, 0.15, 0.10)
"""How much higher what is held is carried, the first that the arm can [m]: legs that walk sink by 8 cm and sway, and
what it is carried over is up to 22 cm high."""
RAISING = 0.15
"""Speed of that [m/s]."""
BENT = ((0.02, 0.1), (0.1, 0.3))
"""How far the hand may leave its line then, and turn [m, rad]; what comes first is tried first."""
ACROSS = 0.1
"""So far beside the robot a place is that of one hand [m]."""
TURN = 0.6
"""How far the robot turns where nothing is remembered at all [rad]."""


@dataclass(frozen=True, slots=True)
class FetchGoal:
    """What to fetch, and where to.

    Attributes:
        text: the thing, in words that localizer and memory know.
        to: x, y where it is set down [m], one after the other; empty: it is brought to where the robot began, in the
            hand.
        frame: what that is given in: `memory`, the frame of what is remembered (`map`, or `odom` without a map);
            `seen`, the same of a place that was recalled, as far off as the head camera that saw it; or `base_link`,
            where the robot stands when the skill begins.
        side: which hand.
        places: how many remembered places are gone to at most.
        search: whether it is searched for where no remembered place has it.
    """

    text: str
    to: tuple[float, ...] = ()
    frame: Literal["memory", "seen", "base_link"] = "memory"
    side: Literal["left", "right", "either"] = "either"
    places: int = 3
    search: bool = True

    def __post_init__(self) -> None:
        if not self.text.strip():
            raise ConfigError("Fetching needs the name of a thing, such as 'mug'.")
        if len(self.to) not in (0, 2) or not all(map(math.isfinite, self.to)):
            raise ConfigError("Where it is set down are two finite numbers, x and y.")
        require("goal of fetching: ", ("places", self.places, 1 <= self.places <= 10, "from 1 to 10"))


@dataclass
class FetchReport:
    """What was done.

    Attributes:
        looked: x, y of the places that were looked at, in odom of the odometry [m], one after the other.
        searched: whether it was searched for.
        approaches: how often the robot stepped to a stance.
        taken: how it was taken.
        x, y: where it was set down, in odom [m].
    """

    looked: list[float] = field(default_factory=list[float])
    searched: bool = False
    approaches: int = 0
    taken: TakeReport = field(default_factory=TakeReport)
    x: float = 0.0
    y: float = 0.0


class Fetch:
    """Bring a thing by its name: recall, go there, take it, carry it, set it down.

    Where it is not at the best remembered place, the next best is tried, then it is searched for. Stages: `recall`,
    `dock`, `search`, those of `navigate`, `take` and `place`, and `done`.
    """

    Goal, Result = FetchGoal, FetchReport

    def timeout(self, goal: FetchGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return 300.0 + 150.0 * (goal.places + 2 * goal.search)

    async def run(self, context: Context, goal: FetchGoal) -> SkillResult:
        """Bring one thing; see `Skill`."""
        start, report = context.t, FetchReport()
        try:
            await context.until(lambda: context.legs.reporting, FIRST_REPORT)
            walks, home = context.legs.status.speed > 0.0, PlanarPose.of(context.legs.pose)
            to = self._destination(context, goal, home)
            nearer = goal if walks or to is None else self._by_the_nearer_hand(context, goal, to)
            try:
                report.taken = await self._take_one(context, nearer, report, walks)
            except StageFailed as failure:
                if nearer is goal:
                    raise
                context.say(failure.stage, f"{failure} Trying with either hand.")
                report.taken = await self._take_one(context, goal, report, walks)
            reason = await self._bring(context, goal, report, walks, home, to)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            timings = {"total": context.t - start}
            return SkillResult(False, failure.stage, failure.slot, str(failure), timings, report)
        context.say("done", reason)
        return SkillResult(True, "done", None, reason, {"total": context.t - start}, report)

    def _destination(self, context: Context, goal: FetchGoal, home: PlanarPose) -> PlanarPose | None:
        """Return where to set it down, in the frame of what is remembered."""
        if not goal.to:
            return None
        place = PlanarPose(goal.to[0], goal.to[1], 0.0)
        return context.T_odom_memory.to(home @ place) if goal.frame == "base_link" else place

    def _by_the_nearer_hand(self, context: Context, goal: FetchGoal, to: PlanarPose) -> FetchGoal:
        """Return the goal for the hand on whose side it is set down, by a robot that stays where it is."""
        T, spot = context.T_odom_base, np.append(_for_hands(context, self._in_odom(context, to)), 0.0)
        aside = float((spot - T[:3, 3]) @ T[:3, 1])
        near = goal.side == "either" and abs(aside) > ACROSS
        return replace(goal, side="left" if aside > 0.0 else "right") if near else goal

    async def _take_one(self, context: Context, goal: FetchGoal, report: FetchReport, walks: bool) -> TakeReport:
        context.say("recall", f"Where is the {goal.text}?")
        places, result = await self._remembered(context, goal), None
        if not places:
            context.say("recall", f"Nothing is remembered of '{goal.text}'. Looking around.")
            await context.run("remember", RememberGoal((goal.text,), 1.0))
            places = await self._remembered(context, goal)
        if not places and not walks:
            result = await self._take(context, goal, None)
        for place in places:
            result = await self._try(context, goal, report, self._in_odom(context, place), walks)
            if result.success or not _elsewhere(result):
                break
            context.say("recall", f"{result.reason} The next best place.")
        if goal.search and walks and (result is None or _elsewhere(result)):
            result = await self._search(context, goal, report, places) or result
        if result is None:
            raise StageFailed("recall", "memory", f"Nothing is remembered of '{goal.text}', nor seen of it.")
        result.check("skill")
        return result.value if isinstance(result.value, TakeReport) else TakeReport()

    async def _remembered(self, context: Context, goal: FetchGoal) -> list[RecalledPlace]:
        """Return where it is or was, best first, each place once."""
        found: list[RecalledPlace] = []
        for when in ("now", "anywhere"):
            answer: RecalledPlaces = await ask(context, goal.text, when, None, goal.places)
            for place in answer.places:
                if all(math.hypot(place.x - p.x, place.y - p.y) > SAME for p in found):
                    found.append(place)
        return found[: goal.places]

    def _in_odom(self, context: Context, place: RecalledPlace | PlanarPose) -> Array:
        """Return (2,) a place of the memory's frame in odom of the odometry [m]."""
        pose = context.T_odom_memory @ PlanarPose(place.x, place.y, 0.0)
        return np.array([pose.x, pose.y])

    async def _try(
        self, context: Context, goal: FetchGoal, report: FetchReport, spot: Array, walks: bool
    ) -> SkillResult:
        """Go before a place and take it there; once more, nearer, where it is seen out of reach."""
        report.looked += [float(v) for v in spot]
        result = SkillResult(False, "take", None, "")
        for _ in range(2):
            if walks:
                report.approaches += await self._go(context, spot)
            result = await self._take(context, goal, spot)
            found = result.value if isinstance(result.value, TakeReport) else TakeReport()
            # One that ended before it saw the thing, or ran out of time, does not say where nearer is.
            if result.success or _elsewhere(result) or not walks or found == TakeReport():
                break
            context.say(result.stage, f"{result.reason} Trying again from a nearer stance.")
            spot = _for_legs(context, found)
        return result

    async def _take(self, context: Context, goal: FetchGoal, spot: Array | None) -> SkillResult:
        near = () if spot is None else tuple(_for_hands(context, spot).tolist())
        return await context.run("take", TakeGoal(goal.text, goal.side, near=near))

    async def _take_in_view(self, context: Context, goal: FetchGoal, report: FetchReport) -> SkillResult:
        """Take it where it is seen from here; out of reach, from before its place."""
        result = await self._take(context, goal, None)
        if result.success or _elsewhere(result) or not isinstance(result.value, TakeReport):
            return result
        context.say(result.stage, f"{result.reason} Trying again from a nearer stance.")
        return await self._try(context, goal, report, _for_legs(context, result.value), True)

    async def _search(
        self, context: Context, goal: FetchGoal, report: FetchReport, places: list[RecalledPlace]
    ) -> SkillResult | None:
        """Look along the counter to both sides of where it was thought to be; ahead and around, where it never was."""
        context.say("search", f"Searching for the {goal.text}.")
        report.searched = True
        result: SkillResult | None = None
        for step in (ASIDE, -2.0 * ASIDE) if places else ():
            await step_back(context)
            here = PlanarPose.of(context.legs.pose)
            aside = here @ PlanarPose(STAGE, step, 0.0)
            report.approaches += await self._go(context, np.array([aside.x, aside.y]))
            result = await self._take_in_view(context, goal, report)
            if result.success or not _elsewhere(result):
                return result
        if not places:
            # From afar the localizer may have overlooked it: nearer to what is ahead first.
            ahead = PlanarPose.of(context.legs.pose) @ PlanarPose(STAGE, 0.0, 0.0)
            report.approaches += await self._go(context, np.array([ahead.x, ahead.y]))
            result = await self._take_in_view(context, goal, report)
            if result.success or not _elsewhere(result):
                return result
        for turn in () if places else (TURN, -2.0 * TURN):
            here = PlanarPose.of(context.legs.pose)
            await self._navigate(context, here @ PlanarPose(0.0, 0.0, turn))
            await context.run("remember", RememberGoal((goal.text,), 1.0))
            for place in await self._remembered(context, goal):
                return await self._try(context, goal, report, self._in_odom(context, place), True)
        return result

    async def _go(self, context: Context, spot: Array, stage: float = STAGE, side: Side | None = None) -> int:
        """Bring the robot before a place in odom, for one hand or either; returns how often it stepped.

        First it goes to the distance `stage` [m].
        """
        here = PlanarPose.of(context.legs.pose)
        away = math.hypot(float(spot[0]) - here.x, float(spot[1]) - here.y)
        # Arms that hold on to a place in odom would be left behind.
        context.release_arms()
        if away > NEAR:
            await self._navigate(context, before(here, spot, stage))
        try:
            return await stand_before(context, spot, side)
        except StageFailed as failure:
            context.say("dock", f"{failure} Going by what is remembered alone.")
            await self._navigate(context, before(PlanarPose.of(context.legs.pose), spot, BLIND))
            return 1

    async def _navigate(self, context: Context, target: PlanarPose) -> None:
        goal = NavigateGoal(target.x, target.y, target.yaw, "odom", content=0.1)
        (await context.run("navigate", goal)).check("navigator")

    async def _bring(
        self, context: Context, goal: FetchGoal, report: FetchReport, walks: bool, home: PlanarPose,
        to: PlanarPose | None,
    ) -> str:  # fmt: skip
        """Carry it to where it is wanted; returns a sentence."""
        taken = report.taken
        side: Side = "left" if taken.side == "left" else "right"
        with context.minding(KeptGrip(context, side, taken.force, goal.text)):
            if walks:
                await self._raise(context, side)
                context.release_arms()
                await step_back(context)
                if to is None:
                    await self._navigate(context, home)
                else:
                    report.approaches += await self._go(context, self._in_odom(context, to), CARRYING, side)
            await context.sleep(context.period)
            await context.until(lambda: context.hands[side].status.holding, 2.0 * PATIENCE)
        if to is None:
            return f"The {goal.text} is in the {side} hand, where the robot began."
        spot = _for_hands(context, self._in_odom(context, to))
        aside, off = (taken.aside_x, taken.aside_y), (taken.off_x, taken.off_y)
        if goal.frame == "seen":
            spot += (1.0 - HANDS) * head_off(context.T_odom_base, spot, off)
        x, y, below, above = float(spot[0]), float(spot[1]), taken.below, taken.above
        there = PlaceGoal(x, y, "odom", side, below, above, aside, off, taken.radius, goal.text)
        (await context.run("place", there)).check("skill")
        report.x, report.y = float(spot[0]), float(spot[1])
        return f"The {goal.text} was set down at ({spot[0]:.2f}, {spot[1]:.2f}) in odom."

    async def _raise(self, context: Context, side: Side) -> None:
        """Lift what is held above what else stands on the counter, as far as the arm can."""
        # Numba takes a second to import, and other skills do without it.
        from golem.skills.planned_motion import PlannedMotion

        motion, T = PlannedMotion(context), context.arms[side].commanded
        for tolerance, height in product(BENT, RAISES):
            with suppress(PlanRefused):
                return await motion.line(side, lifted(T, height), RAISING, tolerance=tolerance)


def _for_hands(context: Context, spot: Array) -> Array:
    """Return (2,) where a `spot` (2,) in odom of the odometry is in that of the base estimate [m]."""
    there = context.T_odom_estimate.to(PlanarPose(float(spot[0]), float(spot[1]), 0.0))
    return np.array([there.x, there.y])


def _for_legs(context: Context, found: TakeReport) -> Array:
    """Return (2,) where a thing was seen by what hands go by, in odom of the odometry [m]."""
    there = context.T_odom_estimate @ PlanarPose(found.x, found.y, 0.0)
    return np.array([there.x, there.y])


def _elsewhere(result: SkillResult) -> bool:
    """Return whether a take says that the thing is not there."""
    return not result.success and result.stage == "detect"
