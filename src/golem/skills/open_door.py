"""Open: take the handle of a door with an upright hinge, and pull it along the circle that the hand finds out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.grasping.base import Grasp
from golem.capabilities.grasping.door_arc import Door, DoorArc, door_behind
from golem.capabilities.grasping.object_cloud import spaced
from golem.capabilities.planning.base import PlanRefused
from golem.errors import ConfigError
from golem.options import require
from golem.skills.base import SkillCancelled, SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.force_guard import CLOSED, open_hand
from golem.skills.palm_look import NEAR
from golem.skills.planned_motion import PlannedMotion, Then
from golem.skills.poses import moved, retracted
from golem.skills.travel import APPROACH, blaming
from golem.types import Array, LocalizedObject, Side

FRAMES = 4
"""Frames of the palm camera that tell where the handle is."""
UNSEEN = 1.0
"""Time without a handle in the palm camera's frames after which there is none to be seen from there [s]."""
VIEWS = ((0.0, 0.07), (0.06, 0.07), (-0.06, 0.07))
"""From how far along the closing axis, and how far back, a handle is looked for that is not seen [m]."""
LEVEL = 0.07
"""Height above and below the grasp within which the handle is looked at [m]."""


async def seen_before(
    context: Context, motion: PlannedMotion, config: OpenConfig, handle: LocalizedObject, grasp: Grasp, side: Side
) -> Grasp:
    """Return the grasp moved to where the palm camera sees the handle; as it is where it sees none.

    Camera and fingers sit on one hand: what the head camera's calibration and the joints are off by drops out. The hand
    is moved across the handle only: how much of its length each camera shows differs. A handle at the edge of the image
    is seen badly, so the hand goes before it and looks again. One that is not seen is looked for from further back and
    from both sides: behind a finger a bar is two short pieces, and at one edge of the image there is no depth.
    """
    context.say("approach", "Looking again with the palm camera.")
    for k in range(config.looks):
        seen, there = await _seen(context, config, handle, side), True
        if seen is None:
            context.say("approach", "The palm camera shows no handle. Looking from beside.")
            seen, there = await _searched(context, motion, config, handle, grasp, side), False
        off = np.zeros(3) if seen is None else np.append((seen - handle.position)[:2], 0.0)
        T = moved(grasp.T_odom_gripper, off)
        motion.displace(off)
        handle, grasp = replace(handle, position=handle.position + off), replace(grasp, T_odom_gripper=T)
        away = float(np.hypot(*off[:2]))
        if seen is not None:
            context.say("approach", f"The handle is {1e3 * away:.0f} mm from where it seemed.")
        if there and (away < config.centred or k == config.looks - 1):
            break
        try:
            await motion.to({side: retracted(T, config.before)}, config.travel_speed, near=NEAR)
        except PlanRefused:
            break
        if seen is None:
            break
    return grasp


async def _searched(
    context: Context, motion: PlannedMotion, config: OpenConfig, handle: LocalizedObject, grasp: Grasp, side: Side
) -> Array | None:
    """Return where (3,) the palm camera shows the handle from further back or from a side; None where it does not."""
    for across, back in VIEWS:
        view = retracted(grasp.T_odom_gripper, config.before + back)
        view = moved(view, across * view[:3, 1])
        try:
            await motion.to({side: view}, config.travel_speed, near=NEAR)
        except PlanRefused:
            continue
        seen = await _seen(context, config, handle, side)
        if seen is not None:
            return seen
    return None


async def _seen(context: Context, config: OpenConfig, handle: LocalizedObject, side: Side) -> Array | None:
    """Return where (3,) the palm camera shows the handle, about where it is expected; None where it shows none."""
    places: list[Array] = []
    with context.watch(f"{side}_hand", handle.label) as eye:
        end, since = context.t + config.look_timeout, context.t
        while len(places) < FRAMES and context.t < end and context.t < since + UNSEEN:
            sightings = await eye.look(end - context.t)
            seen = [] if sightings is None else [_nearest(o, handle.position) for o in sightings.objects]
            away = [float(np.linalg.norm((place - handle.position)[:2])) for place in seen]
            if seen and min(away) < config.trust:
                places.append(seen[int(np.argmin(away))])
                since = context.t
    return np.median(places, axis=0) if places else None


def _nearest(seen: LocalizedObject, position: Array) -> Array:
    """Return the middle of that part of `seen` (3,) that is at the height of `position`."""
    level = np.abs(seen.points[:, 2] - position[2]) < LEVEL
    return np.median(seen.points[level], axis=0) if level.any() else seen.position


SPARED = 0.07
"""Radius around points of the handle within which nothing is in the hand's way [m]."""
EVERY = 0.08
"""Distance of those points [m]."""
PART = 0.07
"""Half the length of the part of a handle that is grasped [m]."""
MOST = 0.06
"""How far the hand may give way [m]."""
SAMPLE = 0.010
"""Distance of two places of the hand that both tell of the circle [m]."""


@dataclass(frozen=True)
class OpenGoal:
    """What to open.

    Attributes:
        label: class of the handle.
        angle: how far [rad].
        side: which hand; `either` takes the one on whose side the handle is.
    """

    label: str = "handle"
    angle: float = 0.40
    side: Literal["left", "right", "either"] = "either"

    def __post_init__(self) -> None:
        if not self.label:
            raise ConfigError("Opening needs the class of the handle.")
        require("goal of opening: ", ("angle", self.angle, 0.02 <= self.angle <= 1.2, "from 0.02 to 1.2 rad"))


@dataclass(frozen=True)
class OpenConfig:
    """Distances, speeds and forces.

    Attributes:
        before: distance from the handle at which the hand arrives [m].
        travel_speed: between places [m/s].
        reach_speed: straight to the handle [m/s].
        pull_speed: of the handle along its circle [m/s].
        force: of each finger [N].
        close_timeout: time the fingers may take [s].
        attempts: how many of the proposed grasps are tried to be reached.
        arrive_gap: least opening to arrive with [m].
        look_again: whether the palm camera corrects the grasp from before the handle; without, all is open loop.
        trust: how far from where it is expected the palm camera may see the handle [m].
        looks: how often the hand is brought before the handle at most, each time by what its camera saw before.
        centred: distance from where it was expected below which one look was enough [m].
        height: of the grasp above base_link, where the handle is as long [m].
        turn: share of the door's turn that the hand takes part in.
        follow: rate at which the hand gives way to a handle that is not in the middle of its fingers [1/s].
        slack: how far the commanded angle may be ahead of the measured one before the door counts as stuck [rad].
        tolerance: distance from a commanded pose at which the arm counts as arrived [m].
        back: how far the hand backs off from the handle at the end [m].
        release_gap: opening that lets go [m].
        look_timeout: time the head camera may take to show the handle [s].
        timeout: time after which it is given up [s].
    """

    before: float = 0.08
    travel_speed: float = 0.25
    reach_speed: float = 0.08
    pull_speed: float = 0.05
    force: float = 16.0
    close_timeout: float = 2.5
    attempts: int = 8
    arrive_gap: float = 0.095
    look_again: bool = True
    trust: float = 0.10
    looks: int = 3
    centred: float = 0.03
    height: float = 0.14
    turn: float = 0.7
    follow: float = 2.0
    slack: float = 0.25
    tolerance: float = 0.008
    back: float = 0.12
    release_gap: float = 0.100
    look_timeout: float = 3.0
    timeout: float = 90.0


@dataclass
class OpenReport:
    """What opening found out.

    Attributes:
        side: hand that pulled.
        angle: how far the door is open, by the measured joints [rad].
        arm: distance of the handle from the hinge, as found out [m].
    """

    side: str = ""
    angle: float = 0.0
    arm: float = 0.0


class OpenDoor:
    """Grasp the handle of a door and pull it open.

    Stages (see `Skill`): `detect`, `approach`, `reach`, `grasp`, `pull`, `release`, `done`.
    """

    Goal, Result = OpenGoal, OpenReport

    def __init__(self, config: OpenConfig | None = None) -> None:
        self._config = config or OpenConfig()
        self._report = OpenReport()

    def timeout(self, goal: OpenGoal) -> float:
        return self._config.timeout

    async def run(self, context: Context, goal: OpenGoal) -> SkillResult:
        timings = {"start": context.t}
        self._report = OpenReport()
        motion, home = PlannedMotion(context), context.commanded_joints.copy()
        result, side = SkillResult(True, "done", None, ""), None
        try:
            whole, handle, door, side = await self._look(context, goal)
            self._report.side = side
            grasp = await self._approach(context, motion, whole, handle, door, side)
            if self._config.look_again:
                grasp = await seen_before(context, motion, self._config, handle, grasp, side)
            await self._grasp(context, motion, grasp, side)
            timings["detect_to_grasp"] = context.t - timings["start"]
            await self._pull(context, door, goal, side)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            result = SkillResult(False, failure.stage, failure.slot, str(failure))
        except SkillCancelled:
            # Stay where we are; what is held stays held.
            context.say("cancelled", "Stopped where it was.")
            raise
        if side is not None:
            await self._release(context, side)
            if not result.success:
                await motion.rest(home, side, self._config.travel_speed, "release")
        timings["total"] = context.t - timings.pop("start")
        if result.success:
            angle = np.rad2deg(self._report.angle)
            text = f"The door is open by {angle:.0f} deg, {self._report.arm:.2f} m from its hinge to the handle."
            context.say("done", text)
            result = replace(result, reason=text)
        return replace(result, timings=timings, value=self._report)

    async def _look(self, context: Context, goal: OpenGoal) -> tuple[Array, LocalizedObject, Door, Side]:
        """Return the handle's points (n, 3), the part to take, its door, and the hand that takes it."""
        context.say("detect", f"Looking for a {goal.label}.")
        with context.watch("head", goal.label) as eye:
            end, seen = context.t + self._config.look_timeout, False
            while True:
                sightings = await eye.look(end - context.t)
                if sightings is None:
                    text = "gave no detections in time" if not seen else f"shows no {goal.label} on a door"
                    raise StageFailed("detect", "localizer", f"The head camera {text}.")
                seen = True
                scene = context.scene("head")
                found = sorted(sightings.objects, key=lambda o: -o.detection.score)
                for handle in (o for o in found if o.label == goal.label):
                    door = door_behind(handle.position, scene)
                    if door is not None:
                        side = self._side(context, goal, handle.position)
                        whole = handle.points if len(handle.points) else handle.position[None]
                        handle = self._part(context, handle)
                        text = f"A {goal.label}, for the {side} hand."
                        context.say("detect", text, target=handle.position.tolist())
                        return whole, handle, door, side

    def _part(self, context: Context, handle: LocalizedObject) -> LocalizedObject:
        """Return the part of a long handle that is at the height at which the arm pulls best."""
        if not len(handle.points):
            return handle
        low, high = np.quantile(handle.points[:, 2], (0.15, 0.85))
        height = float(np.clip(context.T_odom_base[2, 3] + self._config.height, low, high))
        near = handle.points[np.abs(handle.points[:, 2] - height) < PART]
        middle = np.median(near if len(near) else handle.points, axis=0)
        position = handle.points[((handle.points - middle) ** 2).sum(axis=1).argmin()].copy()
        return replace(handle, position=position, points=near, mask=None)

    def _side(self, context: Context, goal: OpenGoal, position: Array) -> Side:
        if goal.side != "either":
            return goal.side
        T = context.T_odom_base
        return "left" if float((T[:3, :3].T @ (position - T[:3, 3]))[1]) > 0.0 else "right"

    async def _approach(
        self, context: Context, motion: PlannedMotion, whole: Array, handle: LocalizedObject, door: Door, side: Side
    ) -> Grasp:
        """Bring the open hand before the handle; returns the grasp that it can go on to."""
        method = context.grasp_method()
        motion.look([(point, SPARED) for point in spaced(whole, EVERY)])
        speed = self._config.travel_speed
        context.say("approach", "Bringing the arm before the door.")
        with blaming("approach"):
            await motion.to_joints(posture(f"forward_{side}"), [side], speed)
        approach = (-float(door.normal[0]), -float(door.normal[1]), 0.0)
        grasps = await context.propose(method, handle, side, 0.0, approach)
        if not grasps:
            raise StageFailed("approach", "grasp_method", f"No grasp was proposed for the {handle.label}.")
        refused: PlanRefused | None = None
        for grasp in grasps[: self._config.attempts]:
            T = grasp.T_odom_gripper
            # Wide open, so that its fingers are not in the palm camera's way.
            context.hands[side].open(max(grasp.gap, self._config.arrive_gap))
            context.say("approach", "Bringing the hand before the handle.", target=T[:3, 3].tolist())
            then = [Then(side, T, self._config.reach_speed, APPROACH)]
            try:
                await motion.to({side: retracted(T, self._config.before)}, speed, then)
                return grasp
            except PlanRefused as refusal:
                refused = refused or refusal
        assert refused is not None
        with blaming("approach"):
            raise refused

    async def _grasp(self, context: Context, motion: PlannedMotion, grasp: Grasp, side: Side) -> None:
        arm, hand = context.arms[side], context.hands[side]
        context.say("reach", "Straight to the handle.")
        with blaming("reach"):
            await motion.line(side, grasp.T_odom_gripper, self._config.reach_speed, tolerance=APPROACH)
        await arm.settle(self._config.tolerance, 2.0)
        context.say("grasp", f"Closing with {self._config.force:g} N per finger.", side=side)
        hand.close(self._config.force)
        await context.until(lambda: hand.status.state in CLOSED, self._config.close_timeout)
        if not hand.status.holding:
            text = f"The fingers hold nothing (gap {hand.status.gap * 1e3:.0f} mm)."
            raise StageFailed("grasp", "grasp_method", text)

    async def _pull(self, context: Context, door: Door, goal: OpenGoal, side: Side) -> None:
        """Pull the handle along its circle until the measured joints say that the door is open."""
        c, arm, hand = self._config, context.arms[side], context.hands[side]
        start, T_start = arm.pose[:3, 3].copy(), arm.commanded.copy()
        arc, last, commanded, shift = DoorArc(start, door), start, 0.0, 0.0
        context.say("pull", "Pulling the door open.")
        while True:
            place = arm.pose[:3, 3]
            if np.linalg.norm(place - last) > SAMPLE:
                arc.add(place)
                last = place.copy()
            angle = arc.angle(place)
            self._report.angle, self._report.arm = angle, arc.arm
            if not hand.status.holding:
                text = f"The handle slipped out of the fingers at {np.rad2deg(angle):.0f} deg."
                raise StageFailed("pull", "grasp_method", text)
            if angle >= goal.angle:
                return
            if commanded - angle > c.slack:
                text = f"The door does not follow beyond {np.rad2deg(angle):.0f} deg."
                raise StageFailed("pull", "upper_body", text)
            commanded += c.pull_speed * context.period / arc.arm
            # The fingers tell where between them the handle is: a hand beside it gives way, and does not prise it out.
            shift = float(np.clip(shift + c.follow * hand.status.offset * context.period, -MOST, MOST))
            T = arc.pose(T_start, commanded, c.turn)
            T[:3, 3] += shift * T[:3, 1]
            arm.approach(T, 3.0 * c.pull_speed)
            await context.tick()

    async def _release(self, context: Context, side: Side) -> None:
        """Let go, and back off; the hand stays there: on its way home the arm might push the door shut."""
        arm = context.arms[side]
        context.say("release", "Letting go.")
        await open_hand(context, side, self._config.release_gap, "release")
        if arm.sent:
            await arm.move(retracted(arm.commanded, self._config.back), self._config.travel_speed)
