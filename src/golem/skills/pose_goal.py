"""What skills that bring base_link to a pose on the floor share: the goal's numbers, and the way there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

from golem.errors import ConfigError
from golem.options import require
from golem.skills.base import SkillResult, StageFailed
from golem.skills.context import Context
from golem.types import PlanarPose, Twist

ZERO = Twist()
MAX_TIMEOUT = 3600.0
"""Longest walk [s] [own: what is given more time is a mistake]."""
FIRST_REPORT = 0.1
"""Time the legs get to report at all [s]."""
MARGIN = 10.0
"""Time a skill that moves the legs gets on top of what its goal says [s]: it ends by itself unless it hangs."""
TURNED = 0.15
"""Error of the heading with which a robot may stand that is content to be near its goal [rad]."""
Frame = Literal["odom", "map"]


def check_numbers(x: float, y: float, yaw: float, timeout: float) -> None:
    """Check the numbers of a goal. Raises ConfigError: one is not finite, or there is no time to walk in."""
    rows = (("x", x), ("y", y), ("yaw", yaw), ("timeout", timeout))
    require("goal of a walk: its ", *((name, v, math.isfinite(v), "a finite number") for name, v in rows))
    fine = 0.0 < timeout <= MAX_TIMEOUT
    require("", ("timeout of a walk", timeout, fine, f"a positive time of at most {MAX_TIMEOUT:g} s"))


def check_reach(context: Context, distance: float, timeout: float) -> None:
    """Check that legs get `distance` [m] far in `timeout` [s]. Raises ConfigError: they cannot; StageFailed: silent."""
    context.legs.check_walking()
    speed = context.legs.status.speed
    reach = speed * timeout
    if distance > reach:
        raise ConfigError(
            f"It is {distance:.3g} m away; at {speed:.2g} m/s the legs get {reach:.3g} m within {timeout:g} s."
        )


@contextmanager
def standing_after_failure(context: Context) -> Iterator[None]:
    """Let the robot stand where a stage fails."""
    try:
        yield
    except StageFailed:
        context.legs.drive(ZERO)
        raise


async def go_to(
    context: Context, target: PlanarPose, frame: Frame, timeout: float, stage: str, content: float = 0.0
) -> SkillResult:
    """Let the navigator bring base_link to `target`, in `frame`, and stand there.

    Within `content` [m] of it, and `TURNED`, the robot stands at once; 0 leaves that to the navigator.

    Feedback about once a second with the data `left` [x, y, yaw] as seen from the robot. Raises StageFailed: it did not
    get there, in `stage`; names the module that could not.
    """
    start, said = context.t, -math.inf
    with context.navigate(target, frame) as way:
        while True:
            await context.tick()
            status, step, left = context.legs.status, way.newest, way.remaining
            distance, turn = math.hypot(left.x, left.y), math.degrees(left.yaw)
            near = distance < content and abs(left.yaw) < TURNED
            if step is not None and (step.arrived or near):
                text = f"Standing {distance * 1e3:.0f} mm and {turn:.1f} deg from the goal{context.legs.doubt}."
                context.say("done", text, left=[left.x, left.y, left.yaw])
                return SkillResult(True, "done", None, text, {"walk": context.t - start})
            if step is not None and step.failure is not None:
                raise StageFailed(stage, "navigator", step.failure)
            if context.t - start >= timeout:
                text = f"Not at the goal after {timeout:g} s: {distance:.2f} m and {turn:.0f} deg are left."
                if status.applied == ZERO and status.reason:
                    raise StageFailed(stage, "lower_body", f"{text} The legs do not move: {status.reason}.")
                raise StageFailed(stage, "navigator", text)
            if context.t - said >= 1.0:
                said = context.t
                doing = f" ({step.note})" if step is not None and step.note else ""
                context.say(stage, f"{distance:.2f} m to go{doing}.", left=[left.x, left.y, left.yaw])
