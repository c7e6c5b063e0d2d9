"""Take: find a thing by its name, grasp it where it stands, lift it, and keep it in the hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.postures import posture
from golem.capabilities.arms.quick_ik import TURNS, QuickIK
from golem.capabilities.grasping.base import Grasp, GraspMethod
from golem.capabilities.grasping.object_cloud import bounds, room_around
from golem.capabilities.planning.base import PlanRefused
from golem.capabilities.properties.base import holding_force
from golem.interfaces.payloads import GripState
from golem.robots.model.magpie_model import MAX_GAP
from golem.skills.base import SkillCancelled, SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.force_guard import close_hand
from golem.skills.palm_look import PalmLook
from golem.skills.planned_motion import PlannedMotion, Then
from golem.skills.poses import lifted, retracted, share_off
from golem.skills.take_config import TakeGoal, TakeReport, TakeThingConfig
from golem.skills.travel import APPROACH, blaming
from golem.skills.ware_sight import find, surface_below
from golem.types import SIDES, Array, LocalizedObject, Side


def reached_first(context: Context, side: Side, grasps: Sequence[Grasp], before: float) -> list[Grasp]:
    """Return `grasps`, best first, in another order: first those that the arm reaches with the least turn of the torso.

    The hand comes along the approach, from `before` the grasp [m].
    """
    ik, q = QuickIK(), context.commanded_joints
    T = np.linalg.inv(context.T_odom_base)
    starts = np.array([q, posture(f"ready_{side}"), posture(f"forward_{side}")])

    def reached(grasp: Grasp) -> bool:
        return ik.approach(side, T @ grasp.T_odom_gripper, before, starts) is not None

    for turn in TURNS:
        starts[:, 0] = q[0] + turn
        found = [reached(grasp) for grasp in grasps]
        if any(found):
            return [grasps[k] for k in sorted(range(len(grasps)), key=lambda k: not found[k])]
    return list(grasps)


SPARE = 0.024
"""How much wider than the grasp asks for the hand arrives [m]: encoders and palm camera are off by a centimetre."""
CENTRED = 0.02
"""Distance along the closing axis within which a thing's middle comes between the fingers as they close [m]."""
OVER_IT = 0.75
"""Cosine of the lean up to which a hand counts as above what it takes."""
AT_HOME = 0.2
"""How far a joint may be from the home posture in an arm that is there [rad]."""
TOP, FORWARD = "top", "forward"


class Take:
    """Grasp a thing by its name where it stands, lift it, and hold it.

    Stages (see `Skill`): `detect`, `approach`, `reach`, `grasp`, `lift`, `done`. Each finger presses with `force` [N].
    """

    Goal, Result = TakeGoal, TakeReport

    def __init__(self, config: TakeThingConfig | None = None) -> None:
        self._config = config or TakeThingConfig()
        self._report = TakeReport()
        self._raised: list[Side] = []
        self.force = self._config.force

    def timeout(self, goal: TakeGoal) -> float:
        return self._config.timeout

    async def run(self, context: Context, goal: TakeGoal) -> SkillResult:
        start, motion, home = context.t, PlannedMotion(context), context.commanded_joints.copy()
        timings: dict[str, float] = {}
        side: Side | None = None
        self.force = await self._tuned(context, goal.label)
        try:
            target = await self._look(context, motion, goal)
            side, grasp = await self._approach(context, motion, goal, target)
            await self._grasp(context, motion, side, grasp)
            timings["detect_to_grasp"] = context.t - start
            await self._lift(context, motion, side, grasp)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            if side is not None or self._report.side:
                await self._leave(context, motion, home)
            self._report.side = ""
            timings["total"] = context.t - start
            return SkillResult(False, failure.stage, failure.slot, str(failure), timings, self._report)
        except SkillCancelled:
            # Stay where we are; what is held stays held.
            context.say("cancelled", "Stopped where it was.")
            raise
        timings["total"] = context.t - start
        text = f"The {side} hand holds the {goal.label}."
        context.say("done", text)
        return SkillResult(True, "done", None, text, timings, self._report)

    async def _tuned(self, context: Context, label: str) -> float:
        """Return the force that a finger holds the thing with [N]."""
        c = self._config
        if not c.tuned:
            return c.force
        thing = await context.properties(label)
        return float(np.clip(holding_force(thing, c.safety, c.squeeze), min(c.touch, c.force), c.force))

    async def _look(self, context: Context, motion: PlannedMotion, goal: TakeGoal) -> LocalizedObject:
        """Return the thing as the head camera sees it, ahead or with the torso turned."""
        c, near = self._config, goal.near[:2] if goal.near else None
        expected = None if near is None else (near[0], near[1])
        context.say("detect", f"Looking for a {goal.label}.")
        target = await find(context, goal.label, expected, c.look_timeout)
        if target is None and c.turn > 0.0:
            context.say("detect", f"The head camera shows no {goal.label}. Looking around.")
            target = await self._look_around(context, motion, goal.label, expected)
        if target is None:
            raise StageFailed("detect", "localizer", f"The head camera shows no {goal.label}.")
        middle = np.median(target.points, axis=0) if len(target.points) else target.position
        self._report.x, self._report.y, self._report.z = (float(v) for v in middle)
        motion.look(room_around(target.points))
        context.say("detect", f"A {goal.label}.", target=middle.tolist())
        return target

    async def _look_around(
        self, context: Context, motion: PlannedMotion, label: str, expected: tuple[float, float] | None
    ) -> LocalizedObject | None:
        """Return the thing as the head camera sees it with the torso turned to either side; None where it does not.

        The arms come along. One that is not at home is brought there first, unless it holds something: hanging low it
        would sweep over what stands there. None turns into what the camera shows ahead. In vain, it turns back.
        """
        c, ahead, home = self._config, context.commanded_joints.copy(), posture("home")
        away: list[Side] = [side for side in SIDES if np.abs((ahead - home)[ARM_COLUMNS[side]]).max() > AT_HOME]
        motion.look()
        for side in away:
            if context.hands[side].status.holding:
                continue
            ahead[ARM_COLUMNS[side]] = home[ARM_COLUMNS[side]]
            try:
                await motion.to_joints(ahead, [side], c.travel_speed)
            except PlanRefused as refusal:
                context.say("detect", f"The torso does not turn, since the {side} arm stays low: {refusal}")
                return None
        for turn in (c.turn, -c.turn, 0.0):
            turned = ahead.copy()
            turned[0] += turn
            try:
                await motion.to_joints(turned, (), c.travel_speed)
            except PlanRefused as refusal:
                context.say("detect", f"The torso does not turn there: {refusal}")
                continue
            target = await find(context, label, expected, c.look_timeout) if turn else None
            if target is not None:
                return target
        return None

    async def _approach(
        self, context: Context, motion: PlannedMotion, goal: TakeGoal, target: LocalizedObject
    ) -> tuple[Side, Grasp]:
        """Bring an open hand before the thing; returns the hand and the grasp that it can go on to.

        A hand that holds something is none of them: it would let that fall.
        """
        T = np.linalg.inv(context.T_odom_base)
        left = float((T[:3, :3] @ target.position + T[:3, 3])[1]) > 0.0
        sides: tuple[Side, ...] = (goal.side,) if goal.side != "either" else SIDES if left else SIDES[::-1]
        full = [side for side in sides if context.hands[side].status.holding]
        sides = tuple(side for side in sides if side not in full)
        if not sides:
            raise StageFailed("approach", "skill", f"The {' and the '.join(full)} hand already holds something.")
        kinds = (goal.approach,) if goal.approach != "either" else (TOP, FORWARD)
        method, why = context.grasp_method(), list[StageFailed]()
        for kind in kinds:
            for side in sides:
                try:
                    return side, await self._come(context, motion, method, target, side, kind)
                except StageFailed as failure:
                    why.append(failure)
                    context.say("approach", f"Not with the {side} hand, {kind}: {failure}")
        raise why[0]

    async def _come(
        self,
        context: Context,
        motion: PlannedMotion,
        method: GraspMethod,
        target: LocalizedObject,
        side: Side,
        kind: str,
    ) -> Grasp:
        """Bring one hand before the thing along one approach, look again, and return the grasp to go on to."""
        c, way = self._config, self._way(context, target, kind)
        yaw = context.heading + (0.5 * math.pi if side == "left" else -0.5 * math.pi)
        self._report.side, self._report.approach = side, kind
        context.say("approach", f"Bringing the {side} hand before the {target.label}, {kind}.", side=side)
        self._raised = [*(one for one in self._raised if one != side), side]
        context.hands[side].open(MAX_GAP)
        scene = context.scene("head")
        with blaming("approach"):
            name = f"{'ready' if kind == TOP else 'forward'}_{side}"
            await motion.to_joints(posture(name), [side], c.travel_speed)
            look = PalmLook(context, motion, side, c)
            if c.look_again:
                target, scene, way = await look.at(target, way, yaw)
                self._report.off_x, self._report.off_y = share_off(context.T_odom_base, target.position, look.off)
        grasps = await context.propose(method, target, side, yaw, (way[0], way[1], way[2]), scene)
        if not grasps:
            raise StageFailed("approach", "grasp_method", f"No grasp was proposed for the {target.label}.")
        grasp = await self._reach_before(context, motion, side, grasps)
        if c.look_again:
            with blaming("approach"):
                grasp, view = await look.before(target, scene, grasp)
            target, scene = replace(target, points=view.thing), view.around
        self._measure(scene, target, grasp)
        return grasp

    def _way(self, context: Context, target: LocalizedObject, kind: str) -> Array:
        """Return the direction (3,) in odom along which the hand is to come."""
        if kind == TOP:
            return np.array([0.0, 0.0, -1.0])
        T = context.T_odom_base
        off = T[:3, :3].T @ (target.position - T[:3, 3])
        # Half of the way towards the thing: an elbow beside the trunk points ahead rather than across.
        heading = math.atan2(T[1, 0], T[0, 0]) + 0.5 * math.atan2(float(off[1]), float(off[0]))
        level, down = math.cos(self._config.lean), -math.sin(self._config.lean)
        return np.array([level * math.cos(heading), level * math.sin(heading), down])

    async def _reach_before(self, context: Context, motion: PlannedMotion, side: Side, grasps: list[Grasp]) -> Grasp:
        """Bring the hand before the first grasp that it gets to, and on to; returns that grasp.

        Those that the arm alone reaches from where it is are tried first: a planner takes longer to refuse.
        """
        c, refused = self._config, list[PlanRefused]()
        for grasp in reached_first(context, side, grasps, c.before)[: c.attempts]:
            T = grasp.T_odom_gripper
            then = [Then(side, T, c.reach_speed, APPROACH)]
            try:
                await motion.to({side: retracted(T, c.before)}, c.travel_speed, then)
                return grasp
            except PlanRefused as refusal:
                refused.append(refusal)
        with blaming("approach"):
            raise refused[0]

    def _measure(self, points: Array, target: LocalizedObject, grasp: Grasp) -> None:
        """Report how high the fingertips take the thing, by `points` (n, 3) around it."""
        tips = float(grasp.T_odom_gripper[2, 3])
        level = surface_below(points, target.position)
        cloud = target.points if len(target.points) else target.position[None]
        low = float(np.quantile(cloud[:, 2], 0.02)) if level is None else level
        self._report.below = max(tips - low, 0.0)
        self._report.above = max(float(np.quantile(cloud[:, 2], 0.98)) - tips, 0.0)
        ends = bounds(cloud)
        middle = 0.5 * (ends[0] + ends[1])
        self._report.radius = 0.5 * float(np.max(ends[1, :2] - ends[0, :2]))
        self._report.x, self._report.y, self._report.z = (float(v) for v in middle)
        T = grasp.T_odom_gripper
        off = middle - T[:3, 3]
        # A hand that leans over a rim has what hangs on it below its palm, too; of what is seen from ahead the middle
        # along the approach is not known.
        above = T[2, 2] < -OVER_IT
        aside = np.linalg.solve(T[:2, :2], off[:2]) if above else off @ T[:3, :2]
        self._report.aside_x, self._report.aside_y = aside.tolist()
        # What the closing fingers do not hold in their middle they bring there, or go to.
        if abs(self._report.aside_y) < CENTRED:
            self._report.aside_y = 0.0

    async def _grasp(self, context: Context, motion: PlannedMotion, side: Side, grasp: Grasp) -> None:
        c, arm, hand = self._config, context.arms[side], context.hands[side]
        hand.open(min(grasp.gap + SPARE, MAX_GAP))
        context.say("reach", "Straight to it.", side=side, target=grasp.T_odom_gripper[:3, 3].tolist())
        await context.until(lambda: hand.status.state is GripState.OPEN, 1.0)
        with blaming("reach"):
            await motion.line(side, grasp.T_odom_gripper, c.reach_speed, tolerance=APPROACH)
        await arm.settle(c.tolerance, 2.0)
        context.say("grasp", f"Closing with {self.force:.3g} N per finger.", side=side)
        # Softly first: the finger that touches first waits for the other instead of pushing the thing over.
        await close_hand(context, side, c.touch, c.close_timeout)
        if not await close_hand(context, side, self.force, c.close_timeout):
            text = f"The fingers hold nothing (gap {hand.status.gap * 1e3:.0f} mm)."
            raise StageFailed("grasp", "grasp_method", text)
        self._report.width, self._report.force = float(hand.status.gap), self.force

    async def _lift(self, context: Context, motion: PlannedMotion, side: Side, grasp: Grasp) -> None:
        """Lift it, back along the approach: up at once, so that it is not dragged."""
        c, arm, hand = self._config, context.arms[side], context.hands[side]
        context.say("lift", "Lifting it.", side=side)
        T = arm.commanded
        rise = max(c.lift + c.before * float(T[2, 2]), 0.0)
        up = lifted(T, 0.5 * c.lift) if rise > 0.02 else T

        def slid() -> bool:
            return not hand.status.holding

        for goal in (up, lifted(retracted(T, c.before), rise)):
            while True:
                await arm.move(goal, c.reach_speed, stop=slid)
                if not slid():
                    break
                if not await close_hand(context, side, self.force, c.close_timeout):
                    raise StageFailed("lift", "grasp_method", "It slipped out of the fingers.")
                context.say("lift", "It slid in the fingers, and is held again.", side=side)

    async def _leave(self, context: Context, motion: PlannedMotion, home: Array) -> None:
        """Open the hand, back off, and go home, as far as it can go; the other hand, too, if it was tried before."""
        side: Side = "left" if self._report.side == "left" else "right"
        arm = context.arms[side]
        context.hands[side].open(MAX_GAP)
        if arm.sent:
            await arm.move(retracted(arm.commanded, self._config.before), self._config.travel_speed)
        for one in reversed(self._raised):
            await motion.rest(home, one, self._config.travel_speed, "approach")
