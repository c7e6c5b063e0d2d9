"""Motions of the arms that are planned before they begin: around what is in the way, and along checked lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Event

import numpy as np

from golem.capabilities.arms.base import ARM_COLUMNS
from golem.capabilities.arms.goal_postures import POSITION, GoalPostures
from golem.capabilities.arms.line import LineChecker
from golem.capabilities.collision.collision_model import CollisionModel
from golem.capabilities.collision.obstacles import World, cleared, displaced, scene_world
from golem.capabilities.planning.base import Held, Plan, PlanRefused, PlanRequest, Refusal
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.capabilities.planning.plan_kernel import ITSELF, WORLD
from golem.capabilities.planning.rules import Rule
from golem.skills.context import Context
from golem.types import SIDES, Array, Side

ROOM = 0.002
"""Distance that links get from each other [m]."""
PAIRS = 8
"""Pairs of links that are brought apart at a time."""
ROUNDS = 40
WITHIN = 0.3
"""How far a joint may turn [rad]: more than hands that lean on the thighs need."""


def apart(space: JointSpace, model: CollisionModel, q: Array) -> Array | None:
    """Return joints (15,) near `q` at which the robot does not touch itself; None where that takes too much [rad].

    Each pair of links in turn moves along the gradient of its distance (Kaczmarz' method), until all have `ROOM`.
    """
    out = np.ascontiguousarray(q, float).copy()
    for _ in range(ROUNDS):
        if space.verdict(out) != ITSELF:
            return out
        near = model.nearest(out, PAIRS, ROOM)
        for distance, gradient in zip(near.distance, near.gradient, strict=True):
            steepness = float(gradient @ gradient)
            if steepness > 0.0:
                out += (ROOM - distance) / steepness * gradient
        out = np.clip(out, space.space.lower, space.space.upper)
        if np.abs(out - q).max() > WITHIN:
            return None
    return None


SCREW: Array = np.array([[0.0, 0.0, z, 0.010] for z in (-0.005, 0.005, 0.015, 0.025)])
"""Balls that hold a screw of 30 mm between the fingertips, in the grasp frame [m]."""
NATURAL_SPEED = 0.4
"""Speed of a hand whose way only finds a posture [m/s]."""
FARTHEST = 2.0
"""How far a joint may turn on a planned way [rad]: beyond, the arm turns over, and later motions of the hand end at
other limits than those that the work area was chosen for."""
TOUCHING = 0.015
"""What the cloud shows this near to the robot, where it stands already, is not in its way [m]."""
GIVEN = 0.05
"""An arm whose joints stay farther than this from where they were sent is held off by something [rad]."""
SETTLE = 0.5
"""Time that arms get to come to where they were sent [s]."""
YIELD = 0.5
"""Speed of a joint that gives in to what holds it off, or brings a link off what it touches [rad/s]."""
STRAIGHT = (0.001, np.deg2rad(0.5))
"""How far a hand may leave a line, and its approach axis turn away from it [m, rad]."""


@dataclass(frozen=True, slots=True)
class Then:
    """A straight line that a hand is to be able to go after a planned motion.

    Attributes:
        side: which hand.
        T_odom_gripper: (4, 4) where the line ends, in odom.
        speed: how fast [m/s].
        tolerance: how far the hand may leave it, distance [m] and angle [rad].
    """

    side: Side
    T_odom_gripper: Array
    speed: float
    tolerance: tuple[float, float] = STRAIGHT


class PlannedMotion:
    """Plans with the stack's planner and moves through the context; `world` is in base_link, empty until `look`."""

    def __init__(self, context: Context) -> None:
        self._context = context
        self._planner = context.modules.planner()
        self._robot, self._goals, self._lines = PlanningRobot(), GoalPostures(), LineChecker()
        self.world = World()

    def look(self, spared: Sequence[tuple[Array, float]] = ()) -> int:
        """Take the cells that the head camera shows, without `spared` (centres, radii in odom [m]); return how many."""
        context = self._context
        T = np.linalg.inv(context.T_odom_base)
        points = context.scene("head") @ T[:3, :3].T + T[:3, 3]
        spheres = self._robot.model().placed(np.ascontiguousarray(context.joints))
        self.world = scene_world(
            points, spheres, [(T[:3, :3] @ centre + T[:3, 3], radius) for centre, radius in spared]
        )
        return 0 if self.world.cloud is None else len(self.world.cloud.balls)

    def displace(self, by: Array) -> None:
        """Move what the head camera showed by `by` (3,) in odom [m]."""
        self.world = displaced(self.world, self._context.T_odom_base[:3, :3].T @ by)

    async def to(
        self,
        targets: Mapping[Side, Array],
        hand_speed: float,
        then: Sequence[Then] = (),
        rules: Sequence[Rule] = (),
        held: Sequence[Held] = (),
        near: float = POSITION,
    ) -> Plan:
        """Bring hands to poses, around what is in the way; return the way that was gone.

        Args:
            targets: (4, 4) poses of the grasp frames in odom, by side; a hand without one stays.
            hand_speed: how fast the hands may move [m/s].
            then: lines that shall be possible from there.
            rules: what the way has to keep.
            near: distance of a hand from its pose that will do [m].

        Raises:
            PlanRefused: there is no such way; the arms are where they were, or a little off what they touched.
            StageFailed: the motors do not report, or the safety gate stays shut.
        """
        context = self._context
        q, world = await self._start(held)
        T = np.linalg.inv(context.T_odom_base)
        in_base: dict[Side, Array] = {side: T @ pose for side, pose in targets.items()}
        lines = [replace(one, T_odom_gripper=T @ one.T_odom_gripper) for one in then]

        def think() -> PlanRequest:
            goals = self._goal_postures(q, world, in_base, lines, rules, held, near)
            return PlanRequest(q, goals, world, rules, held, hand_speed=hand_speed)

        plan = await self._planned(think)
        await self._follow(plan, tuple(targets))
        return plan

    async def to_joints(self, goal: Array, sides: Sequence[Side], hand_speed: float) -> Plan:
        """Bring torso and arms to the joints `goal` (15,) [rad], around what is in the way; see `to`.

        The arms of `sides` move, with the torso; an arm that is not among them stays.
        """
        q, world = await self._start()
        columns = [0, *(j for side in sides for j in range(*ARM_COLUMNS[side].indices(len(q))))]
        wanted = q.copy()
        wanted[columns] = goal[columns]
        plan = await self._planned(lambda: PlanRequest(q, wanted[None], world, hand_speed=hand_speed))
        await self._follow(plan, sides)
        return plan

    async def rest(self, goal: Array, side: Side, hand_speed: float, stage: str) -> None:
        """Look, and bring an arm to the joints `goal` (15,) [rad]; what cannot get there stays, and `stage` says so."""
        self.look()
        try:
            await self.to_joints(goal, [side], hand_speed)
        except PlanRefused as refusal:
            self._context.say(stage, f"The arm stays where it is: {refusal}")

    async def _start(self, held: Sequence[Held] = ()) -> tuple[Array, World]:
        """Return the joints to plan from, and the world without what the robot would touch there: it is there.

        Arms that something holds off give in to it first, and arms that touch the robot come off it.
        """
        context, lower, upper = self._context, self._robot.lower, self._robot.upper

        def arrived() -> bool:
            return bool(np.abs(context.joints - context.commanded_joints).max() < GIVEN)

        if not await context.until(arrived, SETTLE):
            await self._yield(np.clip(context.joints, lower, upper))
        q, world = np.clip(context.commanded_joints, lower, upper), self.world
        space = JointSpace(self._robot, q, world, held=held)
        if space.verdict(q) == ITSELF and (off := apart(space, self._robot.model(held), q)) is not None:
            await self._yield(off)
            q = off
        if world.cloud is not None and space.verdict(q) == WORLD:
            balls = self._robot.model(held).placed(np.ascontiguousarray(q))
            world = World(world.obstacles, cleared(world.cloud, balls, TOUCHING))
        return q, world

    async def _yield(self, q: Array) -> None:
        """Bring torso and arms straight to the joints `q` (15,) [rad] nearby."""
        way = float(np.abs(q - self._context.commanded_joints).max())
        await self._context.follow(np.array([max(0.1, way / YIELD)]), q[None])

    async def _planned(self, request: Callable[[], PlanRequest]) -> Plan:
        """Return the plan for `request()`; a planner on a thread of its own is told when the skill is cancelled."""
        given_up = Event()
        try:
            return await self._context.think(
                lambda: self._planner.plan(replace(request(), stop=given_up.is_set)), self._planner.latency
            )
        except BaseException:
            given_up.set()
            raise

    async def _follow(self, plan: Plan, sides: Sequence[Side]) -> None:
        context = self._context
        # An arm that sags or leans on something gets the time to come to where it was sent.
        off = float(np.abs(context.joints - plan.q[0]).max())
        await context.follow(plan.times + (0.0 if off < GIVEN else off / YIELD), plan.q, plan.dq)
        for side in sides:
            context.arms[side].stays_at(context.T_odom_base @ self._goals.pose(side, plan.q[-1]))

    async def line(
        self,
        side: Side,
        T_goal: Array,
        v_max: float,
        stop: Callable[[], bool] = lambda: False,
        tolerance: tuple[float, float] = STRAIGHT,
        avoid: bool = False,
    ) -> None:
        """Go straight to `T_goal` (4, 4) in odom, if the hand can keep to the line; see `Arm.move`.

        Args:
            v_max: speed [m/s].
            stop: asked every tick.
            tolerance: how far the hand may leave the line, distance [m] and angle [rad].
            avoid: whether the world counts, not the robot itself alone.

        Raises:
            PlanRefused: it cannot; nothing has moved.
        """
        context = self._context
        q = context.commanded_joints
        space = JointSpace(self._robot, q, self.world if avoid else None)
        self._lines.check(side, np.linalg.inv(context.T_odom_base) @ T_goal, q, v_max, 1.5, *tolerance, space)
        await context.arms[side].move(T_goal, v_max, stop=stop)

    def _goal_postures(
        self,
        q: Array,
        world: World,
        targets: Mapping[Side, Array],
        lines: Sequence[Then],
        rules: Sequence[Rule],
        held: Sequence[Held],
        near: float,
    ) -> Array:
        """Return (k, 15) postures to plan to, from which the lines can be gone. Raises PlanRefused: there is none.

        The first choice is the posture in which the arm's own controller would arrive: it is the one that later
        motions along palm targets need not leave.
        """
        space = JointSpace(self._robot, q, world, rules, held)
        itself = JointSpace(self._robot, q, held=held)
        found: list[str] = []

        def free(goal: Array) -> bool:
            if np.abs(goal - q).max() > FARTHEST:
                found.append("its arm would have to turn over")
                return False
            verdict = space.verdict(goal)
            if verdict:
                found.append(space.reason(verdict, goal))
                return False
            try:
                for line in lines:
                    self._lines.check(line.side, line.T_odom_gripper, goal, line.speed, 1.5, *line.tolerance, itself)
            except PlanRefused as error:
                found.append(str(error))
                return False
            return True

        if len(targets) == 1:
            ((side, T),) = targets.items()
            natural = self._lines.check(side, T, q, NATURAL_SPEED, deviation=np.inf, tilt=np.inf)
            if natural.left < near and free(natural.q[-1]):
                return natural.q[-1:]
        left, right = (targets.get(side) for side in SIDES)
        goals = self._goals.find(left, right, q, free)
        if len(goals):
            return goals
        which = " and ".join(targets)
        if not found or self._goals.nearest > POSITION:
            raise PlanRefused(
                Refusal.UNREACHABLE,
                f"The {which} hand gets no nearer than {self._goals.nearest * 1e3:.0f} mm to where it is to go.",
            )
        raise PlanRefused(Refusal.GOAL, f"The {which} hand cannot be where it is to go: {found[0]}.".replace("..", "."))
