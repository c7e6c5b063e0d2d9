"""Walking to a pose, and standing for a while."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from golem.options import require
from golem.skills.base import SkillResult
from golem.skills.context import Context
from golem.skills.pose_goal import FIRST_REPORT, MARGIN, ZERO, check_numbers, check_reach, go_to
from golem.types import PlanarPose


@dataclass(frozen=True, slots=True)
class WalkGoal:
    """Where to walk.

    Attributes:
        x, y, yaw: pose of base_link on the floor [m], [rad].
        frame: what the pose is given in: `odom`, or `base_link`, where the robot stands when the skill begins.
        timeout: time after which the robot gives up and stands [s].
    """

    x: float
    y: float = 0.0
    yaw: float = 0.0
    frame: Literal["base_link", "odom"] = "base_link"
    timeout: float = 60.0

    def __post_init__(self) -> None:
        check_numbers(self.x, self.y, self.yaw, self.timeout)


class Walk:
    """Walk to a pose on the floor and stand there.

    Stages (see `Skill`): `walk`, `done`; feedback about once a second with the data `left` [x, y, yaw] from the robot.
    """

    Goal = WalkGoal

    def timeout(self, goal: WalkGoal) -> float:
        return goal.timeout + MARGIN

    async def run(self, context: Context, goal: WalkGoal) -> SkillResult:
        # Of a robot that was built a moment ago they do so at its first tick.
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        target = PlanarPose(goal.x, goal.y, goal.yaw)
        if goal.frame == "base_link":
            target = PlanarPose.of(context.legs.pose) @ target
        left = PlanarPose.of(context.legs.pose).to(target)
        check_reach(context, math.hypot(left.x, left.y), goal.timeout)
        return await go_to(context, target, "odom", goal.timeout, "walk")


@dataclass(frozen=True, slots=True)
class StandGoal:
    """How long to stand.

    Attributes:
        seconds: time [s].
        height: of base_link above the ground [m], for legs that take one; None is their own.
    """

    seconds: float = 60.0
    height: float | None = None

    def __post_init__(self) -> None:
        require("", ("time to stand for", self.seconds, 0.0 <= self.seconds < math.inf, "zero or more seconds"))


class Stand:
    """Stand for a while, with whatever the lower body does for its balance."""

    Goal = StandGoal

    def timeout(self, goal: StandGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return goal.seconds + MARGIN

    async def run(self, context: Context, goal: StandGoal) -> SkillResult:
        """Stand for a time; see `Skill`."""
        context.say("stand", f"Standing for {goal.seconds:g} s.")
        if goal.height is None:
            context.legs.drive(ZERO)
        else:
            await context.until(lambda: context.legs.reporting, FIRST_REPORT)
            await context.legs.stand_at(goal.height)
        await context.sleep(goal.seconds)
        return SkillResult(True, "done", None, f"Stood for {goal.seconds:g} s.", {"stand": goal.seconds})
