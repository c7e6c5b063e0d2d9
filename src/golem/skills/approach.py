"""The last steps to a stance: straight to it with small steps, without a map."""

from __future__ import annotations

from golem.capabilities.navigation.base import NavInputs
from golem.capabilities.navigation.goto import GoTo, GoToConfig
from golem.skills.context import Context
from golem.types import PlanarPose, Twist

TIMEOUT = 30.0
"""Time that one approach may take [s]."""
APPROACH = GoToConfig(speed=(0.2, 0.15, 0.3), face=5.0)
"""Slow, and always facing as it will stand."""


async def approach(context: Context, navigator: GoTo, target: PlanarPose) -> None:
    """Go straight to a pose in the odometry's frame, and stand, there or after `TIMEOUT`.

    Args:
        context: of the skill.
        navigator: learns with every approach how these legs stop.
        target: where base_link shall be.

    Raises:
        StageFailed: the odometry has fallen silent; the robot stands.
    """
    navigator.start(target)
    end = context.t + TIMEOUT
    try:
        while context.t < end:
            await context.tick()
            status = context.legs.status
            pose = PlanarPose.of(context.legs.pose) @ status.rest
            step = navigator.step(NavInputs(pose, status.moving), context.period)
            context.legs.drive(step.twist)
            if step.arrived:
                return
    finally:
        context.legs.drive(Twist())
