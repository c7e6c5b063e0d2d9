"""Walking to a pose, and standing for a while."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from golem.capabilities.navigation.base import Navigator
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.types import PlanarPose, Twist

ZERO = Twist()


@dataclass(frozen=True, slots=True)
class WalkGoal:
    """Where to walk.

    Attributes:
        x, y, yaw: pose of base_link on the floor [m], [rad].
        frame: what the pose is given in: `odom`, or `base`, where the robot stands when the skill begins.
        timeout: time after which the skill gives up [s].
    """

    x: float
    y: float
    yaw: float = 0.0
    frame: Literal["odom", "base"] = "odom"
    timeout: float = 60.0


class Walk:
    """Walks to a pose on the floor and stands there.

    Stages: `walk`, `done`; feedback about once a second with the data `left` [x, y, yaw] as seen from the robot.
    """

    name = "walk"

    def __init__(self, navigator: Navigator) -> None:
        """Let `navigator` find the way."""
        self._navigator = navigator

    async def run(self, context: Context, goal: WalkGoal) -> SkillResult:
        """Walk to one pose; see `Skill`."""
        context.skill = self.name
        try:
            return await self._pursue(context, goal)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            return SkillResult(False, failure.stage, failure.slot, str(failure))
        finally:
            # However it ends, also by cancellation: the robot stands.
            context.legs.drive(ZERO)

    async def _pursue(self, context: Context, goal: WalkGoal) -> SkillResult:
        start = context.t
        target = PlanarPose(goal.x, goal.y, goal.yaw)
        if goal.frame == "base":
            target = PlanarPose.of(context.legs.pose) @ target
        self._navigator.start(target)
        said = -math.inf
        while True:
            status = context.legs.status
            pose = PlanarPose.of(context.legs.pose) @ status.rest
            course = self._navigator.step(pose, status.moving, context.period)
            left = course.left
            distance, turn = math.hypot(left.x, left.y), math.degrees(left.yaw)
            if course.arrived:
                text = f"Standing {distance * 1e3:.0f} mm and {turn:.1f} deg from the goal."
                context.say("done", text, left=[left.x, left.y, left.yaw])
                return SkillResult(True, "done", None, text, {"walk": context.t - start})
            if context.t - start >= goal.timeout:
                text = (
                    f"Not at the goal after {goal.timeout:g} s: {distance:.2f} m and {turn:.0f} deg are left."
                )
                if status.applied == ZERO and status.reason:
                    raise StageFailed("walk", "lower_body", f"{text} The legs do not move: {status.reason}.")
                raise StageFailed("walk", "navigator", text)
            if context.t - said >= 1.0:
                said = context.t
                context.say("walk", f"{distance:.2f} m to go.", left=[left.x, left.y, left.yaw])
            context.legs.drive(course.twist)
            await context.tick()


@dataclass(frozen=True, slots=True)
class StandGoal:
    """How long to stand.

    Attributes:
        seconds: time [s].
    """

    seconds: float = 60.0


class Stand:
    """Stands, with whatever the lower body does for its balance."""

    name = "stand"

    async def run(self, context: Context, goal: StandGoal) -> SkillResult:
        """Stand for a time; see `Skill`."""
        context.skill = self.name
        context.say("stand", f"Standing for {goal.seconds:g} s.")
        context.legs.drive(ZERO)
        await context.sleep(goal.seconds)
        return SkillResult(True, "done", None, f"Stood for {goal.seconds:g} s.", {"stand": goal.seconds})
