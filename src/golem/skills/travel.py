"""How a skill brings a hand from one place to another: along lines at a safe height, or along planned ways."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Protocol

import numpy as np

from golem.capabilities.arms.postures import posture
from golem.capabilities.planning.base import Held, PlanRefused, Refusal
from golem.skills.base import StageFailed
from golem.skills.context import Context
from golem.skills.planned_motion import SCREW, PlannedMotion, Then
from golem.skills.poses import at_height, lifted
from golem.types import SIDES, Array, Side

SPARED = 0.06
"""Radius around an object that the hand goes to within which nothing is in its way [m]."""
APPROACH = (0.010, np.deg2rad(3.0))
"""How far a hand on its way down may leave the line that the head camera suggests, and turn [m, rad]: the palm camera
corrects it."""
OVER = 0.015
"""How far from its place above an object or a container a hand may arrive [m]: it does not grasp there."""
HANGING = 1.5
"""Arms a joint of which is farther than this from home do not begin their work there [rad]."""
PULL = (0.003, np.deg2rad(1.5))
"""The same of a hand that pulls; sway and encoders off by 0.03 rad do as much."""
ARM_BLAMED = (Refusal.UNREACHABLE, Refusal.OFF_LINE)


def _never() -> bool:
    return False


class Travel(Protocol):
    """Moves hands; every pose is that of a grasp frame in odom, (4, 4)."""

    async def begin(self, speed: float) -> None:
        """Bring hanging arms to where work begins and hands return to. Raises StageFailed: there is no way."""
        ...

    def look(self, targets: Sequence[Array]) -> None:
        """Take the world from what the head camera shows now; `targets` (3,) in odom are what is to be gone to."""
        ...

    def displace(self, by: Array) -> None:
        """Take what was seen for being elsewhere by `by` (3,) in odom [m]."""
        ...

    async def over(self, side: Side, T_object: Array, clearance: float, share: float, speed: float) -> None:
        """Bring an empty hand above an object, to where it can go down straight. Raises StageFailed: it cannot.

        Args:
            side: which hand.
            T_object: of the grasp.
            clearance: how high above it [m].
            share: of the way down that has to be straight, from 0 to 1.
            speed: of the hand [m/s].
        """
        ...

    async def carry(self, side: Side, goals: Sequence[Array], speed: float) -> None:
        """Bring a hand that holds something to the first of some poses it gets to. Raises StageFailed: to none."""
        ...

    async def line(
        self, side: Side, T_goal: Array, speed: float, stage: str, stop: Callable[[], bool] = _never
    ) -> None:
        """Go straight to a pose; ends early once `stop()` is true.

        Raises StageFailed: the hand cannot keep to the line; it has not moved, and `stage` is what failed.
        """
        ...

    async def home(self, side: Side, speed: float) -> None:
        """Bring a hand back to where it was when this was made; it goes whatever is in the way."""
        ...


class LineTravel:
    """Up to a height, across, and down, blind to what is in the way; carries to the first goal. See `Travel`."""

    def __init__(self, context: Context, height: float, tolerance: float) -> None:
        """Remember where the hands are, which move across above `height` in odom and arrive within `tolerance` [m]."""
        self._context, self._height, self._tolerance = context, height, tolerance
        self._homes = {side: context.arms[side].pose for side in SIDES}

    async def begin(self, speed: float) -> None:
        """Stay: lines begin anywhere; hands return to where they are now."""
        self._homes = {side: self._context.arms[side].pose for side in SIDES}

    def look(self, targets: Sequence[Array]) -> None:
        """Look at nothing."""

    def displace(self, by: Array) -> None:
        """Nothing was seen."""

    async def over(self, side: Side, T_object: Array, clearance: float, share: float, speed: float) -> None:
        await self._go(side, lifted(T_object, clearance), speed)

    async def carry(self, side: Side, goals: Sequence[Array], speed: float) -> None:
        await self._go(side, goals[0], speed)

    async def line(
        self, side: Side, T_goal: Array, speed: float, stage: str, stop: Callable[[], bool] = _never
    ) -> None:
        await self._context.arms[side].move(T_goal, speed, stop=stop)

    async def home(self, side: Side, speed: float) -> None:
        await self._go(side, self._homes[side], speed)

    async def _go(self, side: Side, T_goal: Array, speed: float) -> None:
        arm = self._context.arms[side]
        start = arm.commanded
        height = max(start[2, 3], T_goal[2, 3], self._height)
        for T in (at_height(start, height), at_height(T_goal, height), T_goal):
            await arm.move(T, speed)
        await arm.settle(self._tolerance, 1.0)


class PlannedTravel:
    """Around what the head camera shows, with lines that are checked before the hand moves; see `Travel`."""

    def __init__(self, context: Context, lines: LineTravel, tolerance: float) -> None:
        """Remember where the arms are; they arrive within `tolerance` [m], without a planned way home by `lines`."""
        self._context, self._lines, self._tolerance = context, lines, tolerance
        self._motion = PlannedMotion(context)
        self._home = context.commanded_joints.copy()

    async def begin(self, speed: float) -> None:
        """Bring arms that are far from home there, both at once; see `Travel`.

        From arms that hang, as those of a robot do that was just switched on, each way over the work area is long,
        and the hands touch the thighs.
        """
        home = posture("home")
        if np.abs(self._home - home)[1:].max() < HANGING:
            return
        self._context.say("begin", "Raising the arms.")
        with blaming("begin"):
            await self._motion.to_joints(home, SIDES, speed)
        self._home = home
        await self._lines.begin(speed)

    def look(self, targets: Sequence[Array]) -> None:
        self._motion.look([(target, SPARED) for target in targets])

    def displace(self, by: Array) -> None:
        self._motion.displace(by)

    async def over(self, side: Side, T_object: Array, clearance: float, share: float, speed: float) -> None:
        end = lifted(T_object, (1.0 - share) * clearance)
        then = [Then(side, end, speed, APPROACH)] if share else []
        await self._to("approach", side, lifted(T_object, clearance), speed, then=then, near=OVER)

    async def carry(self, side: Side, goals: Sequence[Array], speed: float) -> None:
        """Go around what is in the way of the hand and of the screw; see `Travel`."""
        for i, T in enumerate(goals, start=1):
            try:
                return await self._to("place", side, T, speed, held=[Held(side, SCREW)], near=OVER)
            except StageFailed:
                if i == len(goals):
                    raise

    async def line(
        self, side: Side, T_goal: Array, speed: float, stage: str, stop: Callable[[], bool] = _never
    ) -> None:
        with blaming(stage):
            await self._motion.line(side, T_goal, speed, stop, PULL)

    async def home(self, side: Side, speed: float) -> None:
        """Go back to the joints it began with, or, where no way is found, along lines; see `Travel`."""
        try:
            await self._motion.to_joints(self._home, [side], speed)
        except PlanRefused:
            await self._lines.home(side, speed)

    async def _to(self, stage: str, side: Side, T: Array, speed: float, **options: object) -> None:
        with blaming(stage):
            await self._motion.to({side: T}, speed, **options)  # pyright: ignore[reportArgumentType]
        await self._context.arms[side].settle(self._tolerance, 1.0)


@contextmanager
def blaming(stage: str) -> Iterator[None]:
    """Raise a refused plan as the failure of `stage`: the arm's where it does not reach, else the planner's."""
    try:
        yield
    except PlanRefused as refusal:
        slot = "upper_body" if refusal.refusal in ARM_BLAMED else "planner"
        raise StageFailed(stage, slot, str(refusal)) from refusal
