"""Walking to a pose, and standing for a while."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from golem.errors import ConfigError
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.types import PlanarPose, Twist

ZERO = Twist()
MAX_TIMEOUT = 3600.0
"""Longest walk [s] [own: what is given more time is a mistake, or needs a map]."""
FIRST_REPORT = 0.1
"""Time the legs get to report at all [s]."""
MARGIN = 10.0
"""Time a skill of this file gets on top of what its goal says [s]: it ends by itself unless it hangs."""


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
        """Check the numbers.

        Raises:
            ConfigError: one is not finite, or there is no time to walk in.
        """
        rows = [(name, getattr(self, name)) for name in ("x", "y", "yaw", "timeout")]
        require("goal of a walk: its ", *((name, v, math.isfinite(v), "a finite number") for name, v in rows))
        fine = 0.0 < self.timeout <= MAX_TIMEOUT
        require(
            "", ("timeout of a walk", self.timeout, fine, f"a positive time of at most {MAX_TIMEOUT:g} s")
        )


class Walk:
    """Walk to a pose on the floor and stand there.

    Stages: `walk`, `done`; feedback about once a second with the data `left` [x, y, yaw] as seen from the robot.
    """

    Goal = WalkGoal

    def timeout(self, goal: WalkGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return goal.timeout + MARGIN

    async def run(self, context: Context, goal: WalkGoal) -> SkillResult:
        """Walk to one pose; see `Skill`."""
        try:
            return await self._pursue(context, goal)
        except StageFailed as failure:
            context.say(failure.stage, str(failure), failed=True)
            return SkillResult(False, failure.stage, failure.slot, str(failure))

    async def _pursue(self, context: Context, goal: WalkGoal) -> SkillResult:
        start = context.t
        # Of a robot that was built a moment ago they do so at its first tick.
        await context.until(lambda: context.legs.reporting, FIRST_REPORT)
        target = PlanarPose(goal.x, goal.y, goal.yaw)
        if goal.frame == "base_link":
            target = PlanarPose.of(context.legs.pose) @ target
        check_reach(context, target, goal.timeout)
        said = -math.inf
        with context.navigate(target) as way:
            while True:
                await context.tick()
                status, step, left = context.legs.status, way.newest, way.remaining
                distance, turn = math.hypot(left.x, left.y), math.degrees(left.yaw)
                if step is not None and step.arrived:
                    text = f"Standing {distance * 1e3:.0f} mm and {turn:.1f} deg from the goal."
                    context.say("done", text, left=[left.x, left.y, left.yaw])
                    return SkillResult(True, "done", None, text, {"walk": context.t - start})
                if step is not None and step.failure is not None:
                    raise StageFailed("walk", "navigator", step.failure)
                if context.t - start >= goal.timeout:
                    text = f"Not at the goal after {goal.timeout:g} s: {distance:.2f} m and {turn:.0f} deg are left."
                    if status.applied == ZERO and status.reason:
                        raise StageFailed(
                            "walk", "lower_body", f"{text} The legs do not move: {status.reason}."
                        )
                    raise StageFailed("walk", "navigator", text)
                if context.t - said >= 1.0:
                    said = context.t
                    context.say("walk", f"{distance:.2f} m to go.", left=[left.x, left.y, left.yaw])


def check_reach(context: Context, target: PlanarPose, timeout: float) -> None:
    """Check that the legs can walk, and get to `target`, in odom, within `timeout` [s] at all.

    Raises:
        ConfigError: they cannot.
        StageFailed: they do not report, or the place of the robot is unknown.
    """
    legs = context.legs.status
    if legs.speed == 0.0:
        raise ConfigError(
            f"The legs, '{legs.controller}', do not walk; give the stack a lower_body that does, such as almi."
        )
    left = PlanarPose.of(context.legs.pose).to(target)
    distance, reach = math.hypot(left.x, left.y), legs.speed * timeout
    if distance > reach:
        raise ConfigError(
            f"It is {distance:.3g} m away; at {legs.speed:.2g} m/s the legs get {reach:.3g} m within {timeout:g} s."
        )


@dataclass(frozen=True, slots=True)
class StandGoal:
    """How long to stand.

    Attributes:
        seconds: time [s].
    """

    seconds: float = 60.0

    def __post_init__(self) -> None:
        """Check the time.

        Raises:
            ConfigError: it is not finite, or negative.
        """
        require(
            "", ("time to stand for", self.seconds, 0.0 <= self.seconds < math.inf, "zero or more seconds")
        )


class Stand:
    """Stand for a while, with whatever the lower body does for its balance."""

    Goal = StandGoal

    def timeout(self, goal: StandGoal) -> float:
        """Return the time it may take [s]; see `Skill`."""
        return goal.seconds + MARGIN

    async def run(self, context: Context, goal: StandGoal) -> SkillResult:
        """Stand for a time; see `Skill`."""
        context.say("stand", f"Standing for {goal.seconds:g} s.")
        context.legs.drive(ZERO)
        await context.sleep(goal.seconds)
        return SkillResult(True, "done", None, f"Stood for {goal.seconds:g} s.", {"stand": goal.seconds})
