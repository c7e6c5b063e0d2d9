"""Pick: find an object, bring a hand over it, grasp it, pull it straight out and drop it in a container."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product

import numpy as np

from golem.capabilities.grasping.base import Grasp, GraspMethod, SeeingLaw, ServoLaw, ServoStatus, ServoStep
from golem.capabilities.planning.base import Refusal
from golem.capabilities.policies.observer import Observer
from golem.interfaces import topics
from golem.skills.base import SkillCancelled, SkillResult, StageFailed
from golem.skills.body_interface import CLOSE
from golem.skills.context import Context
from golem.skills.finger_room import FingerRoom
from golem.skills.force_guard import CLOSED, ForceGuard
from golem.skills.hand_offset import Droop, learn_offset
from golem.skills.pack_view import see_fasteners
from golem.skills.pick_config import PickConfig, PickFailed, PickGoal, PickOutcome, PickReport, outcome_of, refusal_of
from golem.skills.pick_place import LEAD, look_after, place, pull, set_back
from golem.skills.pick_targets import SAME, Attempt, PickChoice, TargetChoice, called, names_of
from golem.skills.poses import floor_places, lifted, moved, stands_at
from golem.skills.stance_choice import stance_here
from golem.skills.travel import LineTravel, PlannedTravel, Travel
from golem.types import SIDES, Array, LocalizedObject, Side

FINAL = (PickOutcome.TIGHT, PickOutcome.OUT_OF_REACH)
"""What a second try with the same hand would not change."""
SETTLED = (*FINAL, PickOutcome.JAMMED, PickOutcome.TRAY_OUT_OF_REACH)
"""What a second look would not change either."""
EXPECTED = (0.03, 0.03, 0.045)
"""How far along x, y, z an object may be from where a palm camera is known to show it [m]: two of a real pack are 34 mm
apart, or one is 65 mm lower than the other."""
STRAIGHT = (1.0, 0.5, 0.0)
"""Shares of the way down that are to be straight, the best first."""
SURE = 0.003
"""Uncertainty of the servo's target below which the object was seen [m]."""


class Pick:
    """Find an object, grasp it, pull it straight out and drop it in a container."""

    Goal, Result = PickGoal, PickReport

    def __init__(self, config: PickConfig | None = None) -> None:
        self._config = config or PickConfig()
        self._method: GraspMethod
        self._names: tuple[str, ...] = ()
        self._travel: Travel
        self._report = PickReport()
        self._heights: list[float] = []
        self._looks_again = False
        self._across: float | None = None
        self._pressed = False
        self._goal, self._off, self._sure = PickGoal(), np.zeros(3), False
        self._seen: Array | None = None
        self._from: tuple[Array, float] | None = None

    def timeout(self, goal: PickGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return self._config.timeout

    async def run(self, context: Context, goal: PickGoal) -> SkillResult:
        """Pick one object with whatever grasp method the stack chose; see `Skill`."""
        self._method, self._names = context.grasp_method(), names_of(goal.label, goal.wanted)
        self._off, self._sure = np.array([*(goal.off or (0.0, 0.0)), 0.0]), bool(goal.off)
        self._goal, self._from = goal, None
        await self._choose_height(context, goal)
        lines = LineTravel(context, self._config.travel_height, self._config.tolerance)
        planned = self._config.travel == "planned"
        self._travel = PlannedTravel(context, lines, self._config.tolerance) if planned else lines
        try:
            return await self._pursue(context, goal)
        except SkillCancelled:
            # Stay where we are; what is held stays held.
            context.say("cancelled", "Stopped where it was.")
            raise

    async def _pursue(self, context: Context, goal: PickGoal) -> SkillResult:
        """Go through the stages, and home, whether they succeeded or not."""
        timings: dict[str, float] = {"start": context.t}
        self._report, tried, self._across, self._pressed = PickReport(), list[Attempt](), None, False
        result = SkillResult(True, "done", None, f"The {goal.label} was dropped in the {goal.container}.", timings)
        try:
            await self._travel.begin(self._config.travel_speed)
            choice, attempt = await self._look_and_take(context, goal, timings, tried)
            self._report.outcome = self._report.tried[-1].outcome = PickOutcome.PICKED.value
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            self._note(failure)
            result = SkillResult(False, failure.stage, failure.slot, str(failure), timings)
            for side in _hands(goal, tried):
                context.hands[side].open(self._config.release_gap)
        timings["total"] = context.t - timings.pop("start")
        for side in _hands(goal, tried):
            await self._travel.home(side, self._config.travel_speed)
        if result.success:
            await look_after(context, self._config, attempt, choice, self._names, self._report)
            result = replace(result, reason=f"{result.reason[:-1]}{self._report.seen}.")
            context.say("done", result.reason)
        return replace(result, value=self._report)

    async def _choose_height(self, context: Context, goal: PickGoal) -> None:
        """Stand as low as the hands want it, where the legs take a height."""
        if len(drops := context.legs.drops) == 1:
            return
        avoid, *marks = (floor_places("a pick", places) for places in (goal.avoid, goal.wanted, goal.container_at))
        seen = await see_fasteners(context, goal.label, goal.container, avoid, True, *marks)
        sides = SIDES if goal.side == "either" else (goal.side,)
        stance = stance_here(seen.places, seen.weights, seen.tray, drops, sides)
        if stance.served and abs(stance.drop) > CLOSE:
            text = f"Standing {100.0 * abs(stance.drop):.0f} cm {'lower' if stance.drop > 0.0 else 'higher'}"
            context.say("stand", f"{text}, where {stance.served} are in reach.")
            with suppress(StageFailed):
                await context.legs.stand_at(context.legs.height - stance.drop)

    def _note(self, failure: StageFailed) -> None:
        """Report what a failure says: of the whole, and of the object that was tried last."""
        self._report.outcome = outcome_of(failure).value
        if self._report.tried:
            self._report.tried[-1].outcome = self._report.outcome

    async def _look_and_take(
        self, context: Context, goal: PickGoal, timings: dict[str, float], tried: list[Attempt]
    ) -> tuple[PickChoice, Attempt]:
        """Take and bring the first object that comes of what the head camera shows; `tried` gets what was approached.

        What the palm camera lost or the fingers missed may be found from a second look, since a base that stands moves
        a little. What is tight or out of reach stays so, and is left out.
        """
        choice = await self._look(context, goal)
        try:
            return choice, await self._take_one(context, choice, choice.attempts, timings, tried)
        except StageFailed as failure:
            if not self._looks_again or context.t - timings["start"] > self._config.look_again:
                raise
            context.say(failure.stage, f"{failure} Looking once more.")
            for side in _hands(goal, tried):
                context.hands[side].open(self._config.release_gap)
                await self._travel.home(side, self._config.travel_speed)
            with suppress(StageFailed):
                choice = await self._look(context, goal)
            left = [a for a in choice.attempts if not self._is_settled(a)]
            if not left:
                raise
            return choice, await self._take_one(context, choice, left, timings, tried)

    def _is_settled(self, attempt: Attempt) -> bool:
        """Return whether the hand has tried an object there, and another try would not change how it ended."""
        mine = [one for one in self._report.tried if one.side == attempt.side and one.outcome in SETTLED]
        places = np.array([(one.x, one.y) for one in mine]).reshape(-1, 2)
        return stands_at(attempt.target.position, places, SAME)

    async def _look(self, context: Context, goal: PickGoal) -> PickChoice:
        """Look with the head camera for what to take, and for what is in the way."""
        choice = await TargetChoice(self._config).look(context, goal)
        self._travel.look([attempt.target.position for attempt in choice.attempts])
        return choice

    async def _take_one(
        self, context: Context, choice: PickChoice, attempts: list[Attempt], timings: dict[str, float],
        tried: list[Attempt],
    ) -> Attempt:  # fmt: skip
        """Take the first object that comes out, and bring it; `tried` gets each one that was approached.

        A screw that is tight or jammed, or that this hand brings nowhere, is left for the next one, or for the other
        hand. An open-loop method has no next one: the error that made it miss, that of the head camera, is the same
        everywhere.
        """
        left = list(attempts)
        while True:
            attempt = left.pop(0)
            tried.append(attempt)
            self._report.tried.append(attempt.first_seen)
            try:
                grasp = await self._approach(context, attempt)
                await self._learn(context, attempt)
                await self._take(context, attempt, grasp, timings)
                args = self._config, self._travel, attempt, self._held_at, choice, self._off
                self._report.let_go = await place(context, *args)
                return attempt
            except StageFailed as failure:
                self._note(failure)
                if self._from is not None and context.hands[attempt.side].status.holding:
                    await set_back(context, self._config, self._travel, attempt.side, *self._from)
                refused = failure.stage == "approach"
                if not left or not (refused or self._looks_again):
                    raise
                context.say(failure.stage, f"{failure} Leaving it for the next {attempt.label}.")
                if left[0].side != attempt.side and context.arms[attempt.side].sent:
                    await self._travel.home(attempt.side, self._config.travel_speed)

    @property
    def _held_at(self) -> Array:
        """Return (3,) where the palm camera saw what the hand holds, in odom [m]."""
        last = self._report.tried[-1]
        return np.array([last.x, last.y, last.z]) if self._seen is None else self._seen

    async def _approach(self, context: Context, attempt: Attempt) -> Grasp:
        """Bring the open hand over the object, turned as it can be: first across, where else a finger has no room."""
        if self._across is not None:
            with suppress(StageFailed):
                return await self._over(context, attempt, (self._across, self._across - math.pi))
        best = context.heading + self._config.heading(attempt.side)
        return await self._over(context, attempt, tuple(best + turn for turn in self._config.turns))

    async def _over(self, context: Context, attempt: Attempt, yaws: Sequence[float]) -> Grasp:
        """Bring the open hand over the object at one of `yaws` [rad]: where the way down is straight, or half of it.

        The head camera may be off by half of the way, so what it says of the far end is no reason not to go and look.
        """
        grasps, refused = dict[float, Grasp](), dict[float, StageFailed]()
        for share, yaw in product(STRAIGHT, yaws):
            if yaw not in grasps:
                grasps[yaw] = await self._propose(context, attempt, yaw)
            elif refusal_of(refused[yaw]) is not Refusal.GOAL:
                continue
            try:
                T = grasps[yaw].T_odom_gripper
                await self._travel.over(attempt.side, T, self._config.clearance, share, self._config.travel_speed)
                return grasps[yaw]
            except StageFailed as failure:
                refused[yaw] = failure
        raise refused[yaws[0]]

    async def _propose(self, context: Context, attempt: Attempt, yaw: float) -> Grasp:
        """Return the best grasp at `yaw` [rad], the hand opened for it."""
        grasps = await context.propose(self._method, self._aim(attempt), attempt.side, yaw)
        if not grasps:
            raise StageFailed("approach", "grasp_method", f"No grasp was proposed for the {attempt.label}.")
        target, count = grasps[0].T_odom_gripper[:3, 3].tolist(), len(self._report.tried)
        context.say("approach", "Bringing the hand over it.", target=target, side=attempt.side, attempt=count)
        context.hands[attempt.side].open(grasps[0].gap)
        return grasps[0]

    async def _learn(self, context: Context, attempt: Attempt) -> None:
        """Learn what the hand's own camera is off by, where one object is wanted and may be taken for its neighbour."""
        known = np.array(self._goal.landmarks).reshape(-1, 3)
        if not self._sure and len(known):
            off = await learn_offset(context, attempt.side, self._names, known)
            if off is not None:
                self._off, self._sure = off, True
        self._report.off = tuple(self._off[:2].tolist()) if self._sure else ()

    def _aim(self, attempt: Attempt) -> LocalizedObject:
        """Return the object where the hand's own camera is expected to show it."""
        target = attempt.target
        return replace(target, position=target.position + self._off, points=target.points + self._off)

    def _mine(self, attempt: Attempt, seen: Sequence[LocalizedObject]) -> list[LocalizedObject]:
        """Return what a palm camera shows that may be the object, under its label."""
        aim = attempt.target.position + self._off
        within = EXPECTED if self._sure else (np.inf, np.inf, EXPECTED[2] if self._goal.level else np.inf)
        mine = [one for one in seen if (np.abs(one.position - aim) < within).all()]
        return [called(one, attempt.label) for one in mine]

    async def _take(self, context: Context, attempt: Attempt, grasp: Grasp, timings: dict[str, float]) -> None:
        """Grasp and pull out. A method that looks again may try again; an open-loop one would only repeat itself."""
        self._heights = list[float]()
        for count in range(1, self._config.attempts + 1):
            law = self._method.servo(self._aim(attempt), grasp, context.t)
            self._looks_again = law is not None
            try:
                if law is None:
                    await self._descend(context, attempt, grasp)
                else:
                    await self._servo(context, attempt, law, grasp.gap)
                timings["detect_to_grasp"] = context.t - timings["start"]
                self._from = context.arms[attempt.side].commanded, grasp.gap
                await pull(context, self._config, self._travel, attempt, -grasp.T_odom_gripper[:3, 2], self._heights)
                return
            except StageFailed as failure:
                last = law is None or count == self._config.attempts or outcome_of(failure) in FINAL
                if not last:
                    context.say(failure.stage, f"{failure} Trying again.")
                await self._back_off(context, attempt.side, grasp.gap)
                if last:
                    raise
                if self._across is not None or not await self._above_again(context, attempt, grasp, failure.stage):
                    grasp = await self._approach(context, attempt)

    async def _above_again(self, context: Context, attempt: Attempt, grasp: Grasp, stage: str) -> bool:
        """Bring the hand straight above the object again; returns whether it can keep to the line."""
        above = lifted(grasp.T_odom_gripper, self._config.clearance)
        with suppress(StageFailed):
            await self._travel.line(attempt.side, above, self._config.travel_speed, stage)
            return True
        return False

    async def _descend(self, context: Context, attempt: Attempt, grasp: Grasp) -> None:
        """Open loop: go straight down to the grasp as proposed, and close."""
        arm = context.arms[attempt.side]
        context.say("descend", "Straight down to the proposed grasp.")
        await self._travel.line(attempt.side, grasp.T_odom_gripper, self._config.descend_speed, "descend")
        left = await arm.settle(self._config.tolerance, 2.0)
        if left > 2.0 * self._config.tolerance:
            raise StageFailed("descend", "localizer", f"The hand was stopped {left * 1e3:.0f} mm before the grasp.")
        await self._grip(context, attempt)

    async def _servo(self, context: Context, attempt: Attempt, law: ServoLaw, gap: float) -> None:
        """Closed loop: let the law bring the hand down.

        While the fingers close the hand stays where it was sent last. A finger that comes first moves it aside, both
        hide the object, and what is seen then is a part of it or a neighbour: a hand that follows goes up or off.
        """
        arm, self._seen, droop = context.arms[attempt.side], None, Droop()
        end, down = context.t + law.patience, arm.commanded[:3, 2]
        below = await ForceGuard.at_rest(context, attempt.side, down, self._config.press_force, lead=LEAD)
        room = FingerRoom(context, attempt.side, gap, self._pressed)
        observer = None
        if isinstance(law, SeeingLaw):
            observer = Observer(context.bus, law.cameras, law.width, topics.rgbd_images)
        with context.watch(f"{attempt.side}_hand", *self._names, doubtful=self._names) as eye:
            while True:
                fresh = eye.fresh()
                if isinstance(law, SeeingLaw) and observer is not None:
                    live = context.modules.worker is not None
                    law.see(context.t, attempt.side, context.T_odom_base, observer.observation, live)
                things = None if fresh is None else self._mine(attempt, fresh.objects)
                step = law.step(context.t, things, moved(arm.pose, -room.shift))
                self._seen = followed(self._seen, step)
                if fresh is not None:
                    room.look()
                    text = f"The palm camera guides the hand, sure to {step.sigma * 1e3:.1f} mm."
                    context.say("servo", text, target=step.target.tolist(), hand=arm.pose[:3, 3].tolist())
                if step.status is ServoStatus.CONVERGED:
                    break
                self._check_servo(attempt, step, room)
                if below():
                    self._pressed = True
                    text = f"The hand presses on something with {below.largest:.0f} N."
                    raise PickFailed(PickOutcome.BLOCKED, "servo", "localizer", text)
                if context.t >= end:
                    raise StageFailed("servo", "grasp_method", f"No convergence within {law.patience:g} s.")
                T, speed = room.way(step.T_odom_gripper, arm.pose, self._config.servo_speed)
                arm.approach(moved(T, droop(T, arm.commanded, arm.pose, context.period)), speed)
                await context.tick()
        self._heights.append(self._saw(step))
        await self._grip(context, attempt)

    def _check_servo(self, attempt: Attempt, step: ServoStep, room: FingerRoom) -> None:
        """Raise PickFailed where a law gives up, or the fingers find no room but across."""
        if step.status is ServoStatus.LOST:
            text = f"The palm camera lost the {attempt.label}."
            raise PickFailed(PickOutcome.NOTHING_THERE, "servo", "localizer", text)
        if step.status is ServoStatus.TIGHT:
            self._saw(step)
            text = f"The {attempt.label} stands no higher than a tight one."
            raise PickFailed(PickOutcome.TIGHT, "servo", "grasp_method", text)
        if step.status is ServoStatus.STALLED and room.kept_off:
            raise PickFailed(PickOutcome.BLOCKED, "servo", "grasp_method", "Something stands where a finger is to go.")
        if step.status is ServoStatus.STALLED:
            text = "The hand makes no progress towards the target."
            raise PickFailed(PickOutcome.OUT_OF_REACH, "servo", "upper_body", text)
        if room.across is not None:
            self._across, text = room.across, "Something stands where a finger is to go. Across there is room."
            raise PickFailed(PickOutcome.BLOCKED, "servo", "grasp_method", text)

    def _saw(self, step: ServoStep) -> float:
        """Report where the palm camera sees the object; returns its height in odom [m]."""
        tried = self._report.tried[-1]
        tried.x, tried.y, tried.z = (float(v) for v in step.target)
        return tried.z

    async def _grip(self, context: Context, attempt: Attempt) -> None:
        """Close the fingers; they have to hold something then."""
        hand = context.hands[attempt.side]
        context.say("grasp", f"Closing with {self._config.force:g} N per finger.", side=attempt.side)
        hand.close(self._config.force)
        await context.until(lambda: hand.status.state in CLOSED, self._config.close_timeout)
        if not hand.status.holding:
            text = f"The fingers hold nothing (gap {hand.status.gap * 1e3:.0f} mm)."
            raise PickFailed(PickOutcome.NOTHING_THERE, "grasp", "grasp_method", text)

    async def _back_off(self, context: Context, side: Side, gap: float) -> None:
        """Go straight up, away from what was not taken, the fingers no wider open than they came: walls are near."""
        arm = context.arms[side]
        context.hands[side].open(gap)
        await arm.move(lifted(arm.commanded, self._config.clearance), self._config.travel_speed)


def followed(seen: Array | None, step: ServoStep) -> Array | None:
    """Return where the palm camera sees the object that a servo began with, not the neighbours it went on to.

    Args:
        seen: (3,) where it was seen until now, in odom [m]; None: not yet.
        step: what the servo follows now.
    """
    same = seen is None or float(np.linalg.norm(step.target - seen)) < SAME
    return step.target.copy() if step.sigma < SURE and same else seen


def _hands(goal: PickGoal, tried: Sequence[Attempt]) -> list[Side]:
    """Return the hand of the goal, or those of the attempts, each once."""
    return list(dict.fromkeys(attempt.side for attempt in tried)) if goal.side == "either" else [goal.side]
