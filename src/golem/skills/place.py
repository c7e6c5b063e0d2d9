"""Place: set down what a hand holds, upright, where it is asked to."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.arms.postures import posture
from golem.capabilities.grasping.object_cloud import MIN_POINTS
from golem.capabilities.planning.base import Held, PlanRefused
from golem.capabilities.planning.rules import HandUpright, Rule
from golem.errors import ConfigError
from golem.options import require
from golem.robots.model.magpie_model import MAX_GAP
from golem.skills.base import SkillCancelled, SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.force_guard import ForceGuard, close_hand, open_hand
from golem.skills.planned_motion import PlannedMotion, Then
from golem.skills.poses import at_height, head_off, lifted, retracted
from golem.skills.travel import APPROACH, OVER, blaming
from golem.skills.ware_sight import surface_below
from golem.types import SIDES, Array, Side

TURNS = (0.0, 0.35, -0.35, 0.7, -0.7, 1.05, -1.05)
"""Turns about the vertical in which the hand may set down, in this order [rad]."""
IN_HAND = 0.16
"""Radius around a hand within which the head camera shows what it holds [m]."""
IN_BOWL = 0.10
"""The same around the middle of what hangs beside the fingers [m]: a bowl is 80 mm in radius."""
BESIDE: Array = np.array(
    [(0.0, 0.0), *((r * math.cos(a), r * math.sin(a)) for r in (0.015, 0.03) for a in np.arange(8) * math.pi / 4)]
)
"""Places (17, 2) beside the one that is asked for that will do where something stands there, nearest first [m]."""
HANDS = 0.25
"""Share of what hand and head differ by that is the hand's: its error is half of the head's, as variances 1 : 4."""
PROUD = 0.025
"""Height above a surface from which on something stands there [m]: the head camera is not sure of less."""
IN_WAY = 0.12
"""Distance from the straight way within which things are in it [m]: both are a few centimetres wide."""
ROOM = 0.03
"""Height above such things at which what is held passes [m]."""
STRAIGHT = (0.02, 0.1)
"""How far a hand that carries may leave its line, and turn [m, rad]."""
LEANS = 0.7
"""How far a hand that came from above may lean: over a bowl's rim by 0.5 [rad]."""
NEARBY = 0.06
"""How far beside its place what was set down may stand to be found there [m]."""
EDGE = 0.05
"""How far below a surface what is seen is beyond its edge [m]."""
LYING = 0.6
"""Share of its height below which a thing does not stand."""
PICTURE = 2.0
"""Time that the head camera may take for a picture [s]."""
STANDS = 0.2
"""What stands at a place shows its sides up to here [m]; higher is the arm that holds a thing above it."""
LEAD = 0.25
"""Share of the way down to the place on which the arm's own friction is felt."""
TILT = 0.4
"""How far what is held may lean on the way [rad]."""


@dataclass(frozen=True, slots=True)
class PlaceGoal:
    """Where to set it down.

    Attributes:
        x, y: middle of the place [m].
        frame: what they are given in: `odom`, or `base_link`, where the robot stands when the skill begins.
        side: hand that holds it; `either` is the one that holds anything.
        below: height of the fingertips above the surface when it stands, as `take` reports it [m]; 0 where it is not
            known.
        above: height of its top above the fingertips, as `take` reports it [m].
        aside: where its middle is beside the fingertips along the hand's x and y axes, as `take` reports it [m]; empty:
            between them.
        off: how far from where the head camera has them the hand finds things, as a share of their distance from the
            robot, outwards and to its left, as `take` reports it.
        radius: half of its width, as `take` reports it [m]; 0 where it is not known.
        label: what it is, in words that the localizer knows: the head camera is asked for a picture of it at the end.
            Without one the newest picture that somebody asked for says whether it stands.
    """

    x: float
    y: float
    frame: Literal["odom", "base_link"] = "odom"
    side: Literal["left", "right", "either"] = "either"
    below: float = 0.0
    above: float = 0.0
    aside: tuple[float, ...] = ()
    off: tuple[float, ...] = ()
    radius: float = 0.0
    label: str = ""

    def __post_init__(self) -> None:
        if not (math.isfinite(self.x) and math.isfinite(self.y)):
            raise ConfigError("A place to set something down is two finite numbers, x and y.")
        if any(len(v) not in (0, 2) or not all(map(math.isfinite, v)) for v in (self.aside, self.off)):
            raise ConfigError("What is aside and off, of a thing to set down, are two finite numbers each.")
        require(
            "goal of placing: ",
            ("below", self.below, 0.0 <= self.below <= 0.5, "from 0 to 0.5 m"),
            ("above", self.above, 0.0 <= self.above <= 0.5, "from 0 to 0.5 m"),
            ("radius", self.radius, 0.0 <= self.radius <= 0.5, "from 0 to 0.5 m"),
        )


@dataclass(frozen=True)
class PlaceConfig:
    """Distances, speeds and forces.

    Attributes:
        hover: height above the surface from which it is lowered [m].
        lower: how much further than expected it is lowered at first [m]: the head camera is off by as much.
        deeper: how much further it is lowered then, where nothing was felt; what meets nothing is not let go [m].
        travel_speed: between places [m/s].
        lower_speed: down onto the surface [m/s].
        contact: force at which it stands [N].
        room: free radius without which it is not set down [m].
        spare: what is to be free around it [m], where there is such a place.
        unknown: height of the fingertips above what is held where the goal does not say [m].
        back: how far the hand backs off [m].
        timeout: time after which it is given up [s].
    """

    hover: float = 0.10
    lower: float = 0.05
    deeper: float = 0.04
    travel_speed: float = 0.20
    lower_speed: float = 0.04
    contact: float = 8.0
    room: float = 0.05
    spare: float = 0.02
    unknown: float = 0.10
    back: float = 0.14
    timeout: float = 60.0


@dataclass
class PlaceReport:
    """How it was set down.

    Attributes:
        side: hand that had it.
        x, y, z: where the fingertips let go, in odom [m].
        touched: whether the surface was felt.
    """

    side: str = ""
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    touched: bool = False


class SetDown:
    """Set down what a hand holds, upright, on the surface at a place.

    Stages (see `Skill`): `detect`, `carry`, `lower`, `release`, `done`. Where it fails before `release`, what is held
    stays held.
    """

    Goal, Result = PlaceGoal, PlaceReport

    def __init__(self, config: PlaceConfig | None = None) -> None:
        self._config = config or PlaceConfig()
        self._report = PlaceReport()
        self._off = np.zeros(3)

    def timeout(self, goal: PlaceGoal) -> float:
        return self._config.timeout

    async def run(self, context: Context, goal: PlaceGoal) -> SkillResult:
        start, motion = context.t, PlannedMotion(context)
        try:
            side = self._holder(context, goal)
            self._report.side = side
            if not await self._look(context, goal):
                raise StageFailed("detect", "localizer", f"No new picture of the head camera came in {PICTURE:g} s.")
            spot = self._spot(context, motion, goal, side)
            await self._carry(context, motion, goal, side, spot)
            await self._lower(context, goal, side, float(spot[2]))
            await self._release(context, motion, side)
            if await self._look(context, goal):
                self._stands(context, goal, spot)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            timings = {"total": context.t - start}
            return SkillResult(False, failure.stage, failure.slot, str(failure), timings, self._report)
        except SkillCancelled:
            # Stay where we are; what is held stays held.
            context.say("cancelled", "Stopped where it was.")
            raise
        text = f"Set down at ({self._report.x:.2f}, {self._report.y:.2f}) in odom."
        context.say("done", text)
        return SkillResult(True, "done", None, text, {"total": context.t - start}, self._report)

    def _holder(self, context: Context, goal: PlaceGoal) -> Side:
        for side in SIDES if goal.side == "either" else (goal.side,):
            if context.hands[side].status.holding:
                return side
        who = "Neither hand holds" if goal.side == "either" else f"The {goal.side} hand does not hold"
        raise StageFailed("detect", "grasp_method", f"{who} anything.")

    async def _look(self, context: Context, goal: PlaceGoal) -> bool:
        """Have a new picture: in that by which it was taken, the thing still stands where it was. False: none came."""
        if not goal.label:
            return True
        with context.watch("head", goal.label) as eye:
            return await eye.look(PICTURE) is not None

    def _spot(self, context: Context, motion: PlannedMotion, goal: PlaceGoal, side: Side) -> Array:
        """Return the (3,) middle of the place on its surface, in odom, after a look whether it is free."""
        T, hand = context.T_odom_base, context.arms[side].pose[:3, 3]
        spot = np.array([goal.x, goal.y, 0.0])
        if goal.frame == "base_link":
            spot = T[:3, :3] @ spot + T[:3, 3]
        # From here on the place is where this hand would find it.
        self._off = np.append(head_off(T, spot, goal.off), 0.0)
        spot += HANDS * self._off
        context.say("detect", "Looking at the place.", target=spot.tolist())
        motion.look([(hand, IN_HAND)])
        motion.displace(self._off)
        scene = self._scene(context, goal, context.arms[side].pose)
        level = surface_below(scene, spot)
        if level is None:
            raise StageFailed("detect", "localizer", "The head camera shows no surface at that place.")
        spot[2] = level
        away = np.linalg.norm(scene[:, :2] - spot[:2], axis=1)
        if np.count_nonzero((scene[:, 2] < level - EDGE) & (away < goal.radius)) > MIN_POINTS:
            raise StageFailed("detect", "skill", "The surface ends within the width of what would stand at that place.")
        proud = scene[(scene[:, 2] > level + PROUD) & (scene[:, 2] < level + STANDS), :2]
        c = self._config
        # The head camera is off by centimetres: what looks too narrow for the thing may do, less than `room` does not.
        for room, beside in product((max(goal.radius + c.spare, c.room), c.room), BESIDE):
            near = np.linalg.norm(proud - spot[:2] - beside, axis=1) < room
            if np.count_nonzero(near) <= MIN_POINTS:
                return spot + (*beside, 0.0)
        raise StageFailed("detect", "localizer", "Something else stands at that place.")

    async def _carry(self, context: Context, motion: PlannedMotion, goal: PlaceGoal, side: Side, spot: Array) -> None:
        """Bring the hand above the place, what it holds upright."""
        c, arm = self._config, context.arms[side]
        below = goal.below or c.unknown
        held = Held(side, _column(arm.pose, below, goal.above))
        at = np.array([spot[0], spot[1], spot[2] + below + c.hover])
        context.say("carry", "Carrying it there.", target=at.tolist(), side=side)
        over = self._tallest(self._scene(context, goal, arm.pose), arm.pose[:3, 3], at) + below + ROOM
        goals = [self._turned(arm.commanded, turn, at, goal.aside or (0.0, 0.0)) for turn in TURNS]
        # At the height of the hand, or where the arm cannot, as low as what is in the way lets it.
        levels = (max(float(arm.commanded[2, 3]), over), over)
        for T, level in product(goals, levels):
            # Straight there and down, as long as the arm can: planned ways of a hand are long ways for a thing.
            try:
                up = at_height(arm.commanded, max(float(T[2, 3]), level))
                for stop in (up, at_height(T, up[2, 3]), T):
                    await motion.line(side, stop, c.travel_speed, tolerance=STRAIGHT)
                return
            except PlanRefused:
                continue
        refused: PlanRefused | None = None
        for T in goals:
            then = [Then(side, lifted(T, -c.hover), c.lower_speed, APPROACH)]
            try:
                await motion.to({side: T}, c.travel_speed, then, self._upright(context, side), [held], OVER)
                return
            except PlanRefused as refusal:
                refused = refused or refusal
        assert refused is not None
        with blaming("carry"):
            raise refused

    def _scene(self, context: Context, goal: PlaceGoal, T: Array) -> Array:
        """Return the points (n, 3) in odom that the head camera shows, as this hand finds them, less what it holds."""
        scene = context.scene("head") + self._off
        beside = np.append(T[:2, :2] @ (goal.aside or (0.0, 0.0)), 0.0)
        for middle, radius in ((T[:3, 3], IN_HAND), (T[:3, 3] + beside, IN_BOWL)):
            # Distance from what is there and from what hangs below it.
            away = scene - middle
            away[:, 2] -= np.clip(away[:, 2], -goal.below, 0.0)
            scene = scene[np.linalg.norm(away, axis=1) > radius]
        return scene

    @staticmethod
    def _tallest(scene: Array, here: Array, there: Array) -> float:
        """Return the height of the tallest of `scene` (n, 3) on the straight way between two places (3,) [m]."""
        way = (there - here)[:2]
        share = np.clip((scene[:, :2] - here[:2]) @ way / max(float(way @ way), 1e-6), 0.0, 1.0)
        off = np.linalg.norm(scene[:, :2] - here[:2] - share[:, None] * way, axis=1)
        near = scene[(off < IN_WAY) & (scene[:, 2] < here[2] + 0.2)]
        return float(np.quantile(near[:, 2], 0.995)) if len(near) else -np.inf

    @staticmethod
    def _turned(T: Array, turn: float, at: Array, aside: tuple[float, ...]) -> Array:
        """Return pose `T` (4, 4) turned by `turn` about the vertical [rad], with what is `aside` it at `at` (3,)."""
        moved = T.copy()
        moved[:3, :3] = Rotation.from_euler("z", turn).as_matrix() @ T[:3, :3]
        moved[:3, 3] = at
        moved[:2, 3] -= moved[:2, :2] @ aside
        return moved

    def _upright(self, context: Context, side: Side) -> list[Rule]:
        """Return the rule that what is held does not lean: a hand that came from above goes on looking down."""
        z = context.arms[side].commanded[:3, 2]
        lean = math.acos(min(-float(z[2]), 1.0)) if z[2] < 0.0 else math.pi
        return [HandUpright(side, TILT + lean)] if lean < LEANS else []

    async def _lower(self, context: Context, goal: PlaceGoal, side: Side, level: float) -> None:
        """Lower it until it stands: where the surface is felt, or a little deeper than where it was seen."""
        c, arm, hand = self._config, context.arms[side], context.hands[side]
        force = float(hand.status.force.max())

        async def hold() -> None:
            """Hold what slid in the fingers again, as firmly as it was."""
            if not hand.status.holding and not await close_hand(context, side, force):
                raise StageFailed("carry", "grasp_method", "It was lost on the way.")

        await hold()
        context.say("lower", "Lowering it.", side=side)
        await arm.settle(0.006, 1.0)
        guard = await ForceGuard.at_rest(context, side, np.array([0.0, 0.0, -1.0]), c.contact, lead=LEAD * c.hover)

        def stops() -> bool:
            return guard() or not hand.status.holding

        T = arm.commanded.copy()
        T[2, 3] = level + (goal.below or c.unknown) - c.lower
        for further in (0.0, c.deeper):
            T[2, 3] -= further
            await arm.move(T, c.lower_speed, stop=stops)
            if not guard.stuck and arm.commanded[2, 3] - T[2, 3] > 2.0 * c.lower:
                await hold()
                await arm.move(T, c.lower_speed, stop=stops)
            if guard.stuck or not hand.status.holding:
                break
        else:
            await arm.move(lifted(T, c.hover + c.lower + c.deeper), c.lower_speed)
            away = f"{100 * (c.lower + c.deeper):.0f} cm below where it was seen"
            raise StageFailed("lower", "localizer", f"No surface was felt to {away}; it stays held.")
        self._report.touched = guard.stuck
        if guard.stuck:
            # What presses on the surface springs back: give way by what the arm is behind.
            arm.stays_at(at_height(arm.commanded, float(arm.pose[2, 3])))
        self._report.x, self._report.y, self._report.z = (float(v) for v in arm.pose[:3, 3])

    async def _release(self, context: Context, motion: PlannedMotion, side: Side) -> None:
        c, arm = self._config, context.arms[side]
        context.say("release", "Letting go.", side=side)
        await open_hand(context, side, min(context.hands[side].status.gap + 0.03, MAX_GAP), "release")
        T = retracted(arm.commanded, c.back)
        await arm.move(T, 0.5 * c.travel_speed)
        if T[2, 2] > -0.9:
            await arm.move(lifted(T, 0.5 * c.back), c.travel_speed)
        await motion.rest(posture("home"), side, c.travel_speed, "release")

    def _stands(self, context: Context, goal: PlaceGoal, spot: Array) -> None:
        """Look whether it stands, as the head camera shows. Raises StageFailed: nothing does, or what is much lower."""
        scene = context.scene("head") + self._off
        near = scene[np.linalg.norm(scene[:, :2] - spot[:2], axis=1) < goal.radius + NEARBY]
        height = near[:, 2] - spot[2]
        if np.count_nonzero(np.abs(height) < PROUD) <= MIN_POINTS:
            return  # the place is not seen
        proud = height[(height > PROUD) & (height < 0.4)]
        if len(proud) <= MIN_POINTS:
            raise StageFailed("release", "grasp_method", "Nothing stands where it was set down.")
        tall, top = goal.below + goal.above, float(np.quantile(proud, 0.98))
        if goal.below and top < LYING * tall:
            why = f"What was {100 * tall:.0f} cm high is {100 * top:.0f} cm now: it fell over."
            raise StageFailed("release", "grasp_method", why)


def _column(T: Array, below: float, above: float) -> Array:
    """Return balls (k, 4) in the grasp frame of a hand at `T` (4, 4) that cover an upright thing [m]."""
    down = T[:3, :3].T @ np.array([0.0, 0.0, -1.0])
    # The lowest ball ends above the surface that the thing stands on.
    heights = np.linspace(-above, max(below - 0.05, -above), 4)
    return np.column_stack([heights[:, None] * down, np.full(len(heights), 0.035)])
