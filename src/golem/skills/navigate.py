"""Walking to a pose around what is in the way, by the map."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.skills.pose_goal import FIRST_REPORT, MARGIN, check_numbers, check_reach, go_to, standing_after_failure
from golem.types import PlanarPose

FIRST_MAP = 8.0
"""Time that odometry and mapper get to begin [s]: an odometry by LiDAR stands still for a second or two first."""


@dataclass(frozen=True, slots=True)
class NavigateGoal:
    """Where to go.

    Attributes:
        x, y, yaw: pose of base_link on the floor [m], [rad].
        frame: what the pose is given in: `map`; `odom`, that of the odometry; or `base_link`, where the robot stands
            when the skill begins.
        timeout: time after which the robot gives up and stands [s].
        content: distance from the goal within which the robot stands at once [m]: for a place on the way to another;
            0 has the navigator correct every stop.
    """

    x: float
    y: float = 0.0
    yaw: float = 0.0
    frame: Literal["map", "odom", "base_link"] = "map"
    timeout: float = 180.0
    content: float = 0.0

    def __post_init__(self) -> None:
        check_numbers(self.x, self.y, self.yaw, self.timeout)
        require("", ("content of a goal", self.content, 0.0 <= self.content <= 1.0, "a distance of at most 1 m"))


class Navigate:
    """Walk to a pose around what is in the way, and stand there; cancelled, the robot stands where it is.

    Stages (see `Skill`): `locate` (the place in the map is looked for), `navigate`, `done`.
    """

    Goal = NavigateGoal

    def timeout(self, goal: NavigateGoal) -> float:
        return goal.timeout + FIRST_MAP + MARGIN

    async def run(self, context: Context, goal: NavigateGoal) -> SkillResult:
        with standing_after_failure(context):
            target, frame = await self._target(context, goal)
            return await go_to(context, target, frame, goal.timeout, "navigate", goal.content)

    async def _target(self, context: Context, goal: NavigateGoal) -> tuple[PlanarPose, Literal["odom", "map"]]:
        """Return the goal, and the frame it is pursued in: the map's where there is a map."""
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        target = PlanarPose(goal.x, goal.y, goal.yaw)
        if not await context.until(lambda: context.mapped, FIRST_MAP):
            context.legs.check_located()
            if goal.frame == "map":
                raise StageFailed(
                    "locate",
                    "mapper",
                    f"There is no map after {FIRST_MAP:g} s: the stack needs an odometry that goes by the LiDAR, such "
                    "as lio, the robot has to stand still when it begins, and a map from before has to fit.",
                )
            if goal.frame == "base_link":
                target = PlanarPose.of(context.legs.pose) @ target
            frame: Literal["odom", "map"] = "odom"
            left = PlanarPose.of(context.legs.pose).to(target)
        else:
            T_map_base = context.T_odom_map.to(PlanarPose.of(context.legs.pose))
            if goal.frame == "base_link":
                target = T_map_base @ target
            elif goal.frame == "odom":
                target = context.T_odom_map.to(target)
            frame, left = "map", T_map_base.to(target)
        check_reach(context, math.hypot(left.x, left.y), goal.timeout)
        return target, frame
