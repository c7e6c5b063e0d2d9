"""A skill's motion of torso and arms along a timed joint trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from golem.capabilities.arms.trajectory import check_trajectory
from golem.interfaces import topics
from golem.interfaces.payloads import GateState, JointTrajectory
from golem.skills.base import StageFailed
from golem.types import Array

if TYPE_CHECKING:
    from golem.skills.context import Context

GATE_TIMEOUT = 1.0
"""For so long a trajectory waits until the safety gate lets commands through [s]."""


async def follow(context: Context, times: Array, q: Array, dq: Array | None) -> float:
    """Move the arms along a trajectory; see `Context.follow`."""
    check_trajectory(JointTrajectory(context.t, times, q, dq), context.joints)
    await _gate_opens(context)
    for arm in context.arms.values():
        arm.forget()
    context.send_palms()  # to nowhere: an older target must not pull at arms that are stopped on the way
    context.publish(topics.ARM_TRAJECTORY, JointTrajectory(context.t, times, q, dq))
    try:
        await context.sleep(float(times[-1]))
    except BaseException:
        stop = JointTrajectory(context.t, np.zeros(0), np.zeros((0, q.shape[1])))
        context.publish(topics.ARM_TRAJECTORY, stop)
        raise
    return float(np.abs(context.joints - q[-1]).max())


async def _gate_opens(context: Context) -> None:
    """Wait until the safety gate is open: the stack drops trajectories from before that."""

    def opened() -> bool:
        status = context.bus.latest(topics.SAFETY)
        return status is not None and status.state is GateState.ACTIVE

    if not await context.until(opened, GATE_TIMEOUT):
        raise StageFailed("move", "safety", "The safety gate lets no commands through.")
    await context.tick()
