"""Docking: the robot puts its feet where its hands can work, measured from the edge of the pack before it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.edge_fit import NearEdge, near_edge
from golem.capabilities.navigation.goto import GoTo, GoToConfig
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavStep
from golem.middleware.bus import News
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pose_goal import FIRST_REPORT, MARGIN
from golem.types import Array, PlanarPose, Twist

RIM = (0.84, 1.06)
"""Heights above the floor between which points are the pack's and not its stand's [m]."""
LOOK = 1.2
"""Time over which scans are put together while the robot stands [s]."""
SETTLE = 1.0
"""Time that the body gets to come to rest before [s]."""
FARTHEST = 1.8
"""Longest way to the stance [m]: more is a way for `navigate`."""
STEP = 30.0
"""Time that one approach may take [s]."""
APPROACH = GoToConfig(speed=(0.2, 0.15, 0.3), face=5.0)


@dataclass(frozen=True, slots=True)
class DockGoal:
    """Where to stand.

    Attributes:
        standoff: distance from base_link to the edge [m].
        lateral: where along the edge, from its middle, to the left [m].
        tolerance: distance from the stance that is good enough [m]: a stop moves the robot by more than 1 cm.
        turned: the same of the heading [rad].
        approaches: how often it is tried; the best counts.
    """

    standoff: float = 0.42
    lateral: float = 0.0
    tolerance: float = 0.03
    turned: float = 0.05
    approaches: int = 3

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ConfigError: one of them cannot be meant.
        """
        require(
            "goal of docking: ",
            ("standoff", self.standoff, 0.3 <= self.standoff <= 1.5, "from 0.3 to 1.5 m"),
            ("lateral", self.lateral, abs(self.lateral) <= 1.0, "at most 1 m to either side"),
            (
                "tolerance",
                self.tolerance,
                0.0 < self.tolerance <= 0.2,
                "a positive distance of at most 0.2 m",
            ),
            ("turned", self.turned, 0.0 < self.turned <= 0.5, "a positive angle of at most 0.5 rad"),
            ("approaches", self.approaches, 1 <= self.approaches <= 10, "from 1 to 10"),
        )


class Dock:
    """Stand before the pack, measured from its near edge: look, approach with small steps, settle, look again.

    Stages: `look`, `approach`, `done`. It ends when the stance is good enough, or no approach has made it better.
    """

    Goal = DockGoal

    def timeout(self, goal: DockGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return (goal.approaches + 1) * (STEP + SETTLE + LOOK + 2.0) + MARGIN

    async def run(self, context: Context, goal: DockGoal) -> SkillResult:
        """Dock; see `Skill`."""
        try:
            return await self._dock(context, goal)
        except StageFailed as failure:
            context.legs.drive(Twist())
            context.say(failure.stage, str(failure), failed=True)
            return SkillResult(False, failure.stage, failure.slot, str(failure))

    async def _dock(self, context: Context, goal: DockGoal) -> SkillResult:
        start, navigator = context.t, GoTo(APPROACH)
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        if context.legs.status.speed == 0.0:
            raise ConfigError(
                f"The legs, '{context.legs.status.controller}', do not walk; choose others, such as almi."
            )
        left, edge = await self._look(context, goal)
        approaches = 0
        while not self._good(left, goal) and approaches < goal.approaches:
            if math.hypot(left.x, left.y) > FARTHEST:
                raise StageFailed(
                    "look",
                    "dock",
                    f"The stance is {math.hypot(left.x, left.y):.2f} m away; navigate nearer first.",
                )
            await self._approach(context, navigator, PlanarPose.of(context.legs.pose) @ left)
            approaches += 1
            left, edge = await self._look(context, goal)
        off, turn = math.hypot(left.x, left.y), math.degrees(left.yaw)
        text = (
            f"Standing {100 * off:.1f} cm and {turn:.1f} deg from the stance after {approaches} approaches, by an edge "
            f"of {edge.length:.2f} m that is straight to {1e3 * edge.spread:.0f} mm."
        )
        context.say("done", text, left=[left.x, left.y, left.yaw])
        if not self._good(left, goal):
            return SkillResult(False, "approach", "lower_body", f"Not near enough. {text}")
        return SkillResult(True, "done", None, text, {"dock": context.t - start})

    def _good(self, left: PlanarPose, goal: DockGoal) -> bool:
        return math.hypot(left.x, left.y) <= goal.tolerance and abs(left.yaw) <= goal.turned

    async def _look(self, context: Context, goal: DockGoal) -> tuple[PlanarPose, NearEdge]:
        """Return the stance as seen from the robot, and the edge that it was measured from."""
        context.legs.drive(Twist())
        await context.sleep(SETTLE)
        news, points = News(context.bus, topics.SCAN), list[Array]()
        end = context.t + LOOK
        while context.t < end:
            await context.tick()
            scan = news.read()
            if scan is not None:
                heights = scan.heights
                points.append(scan.points[(heights > RIM[0]) & (heights < RIM[1]), :2])
        if not points:
            raise StageFailed(
                "look", "robot", "No scan comes: docking needs a LiDAR, and an odometry that goes by it."
            )
        here = PlanarPose.of(context.legs.pose)
        edge = near_edge(np.concatenate(points), here)
        if isinstance(edge, str):
            raise StageFailed("look", "dock", edge)
        left = here.to(edge.pose @ PlanarPose(-goal.standoff, goal.lateral, 0.0))
        context.say(
            "look",
            f"{100 * math.hypot(left.x, left.y):.1f} cm from the stance.",
            left=[left.x, left.y, left.yaw],
        )
        return left, edge

    async def _approach(self, context: Context, navigator: GoTo, target: PlanarPose) -> None:
        """Go straight to a pose in odom, and stand."""
        navigator.start(target)
        end = context.t + STEP
        try:
            while context.t < end:
                await context.tick()
                status = context.legs.status
                pose = PlanarPose.of(context.legs.pose) @ status.rest
                step: NavStep = navigator.step(NavInputs(pose, status.moving), context.period)
                context.legs.drive(step.twist)
                if step.arrived:
                    return
        finally:
            context.legs.drive(Twist())
