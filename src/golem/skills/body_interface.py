"""Grippers, joints and the navigator, as a skill commands and reads them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from golem.capabilities.arms.trajectory import check_trajectory
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavGoal, NavStep
from golem.interfaces.payloads import GateState, HandGoal, HandStatus, JointTrajectory
from golem.skills.base import StageFailed
from golem.types import Array, PlanarPose, Side, Twist

if TYPE_CHECKING:
    from golem.skills.context import Context

if TYPE_CHECKING:
    from golem.skills.context import Context

if TYPE_CHECKING:
    from golem.skills.context import Context


class Navigation:
    """The navigator drives the legs to a goal while this is open (a context manager); then the robot stands."""

    def __init__(self, context: Context, goal: PlanarPose, frame: Literal["odom", "map"] = "odom") -> None:
        """Go to `goal`, in `frame`."""
        self._context, self._goal = context, goal
        self._frame: Literal["odom", "map"] = frame
        self._seen = 0

    def __enter__(self) -> Navigation:
        """Set off."""
        self._seen = self._context.bus.count(topics.NAV_STEP)
        self._context.publish(topics.NAV_GOAL, NavGoal(self._goal, self._frame))
        return self

    def __exit__(self, *_: object) -> None:
        """Stand, wherever the robot is."""
        self._context.publish(topics.NAV_GOAL, NavGoal(None))
        self._context.legs.drive(Twist())

    @property
    def newest(self) -> NavStep | None:
        """The navigator's newest step towards this goal; None before the first."""
        bus = self._context.bus
        return bus.latest(topics.NAV_STEP) if bus.count(topics.NAV_STEP) > self._seen else None

    @property
    def remaining(self) -> PlanarPose:
        """Where the goal is as seen from the robot, by the navigator; before its first step, by the odometry.

        Raises:
            StageFailed: the odometry has fallen silent, or the robot's place in the map is not known.
        """
        pose = self._context.legs.pose
        if self.newest is not None:
            return self.newest.left
        goal = self._goal if self._frame == "odom" else self._context.T_odom_map @ self._goal
        return PlanarPose.of(pose).to(goal)


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


class HandInterface:
    """One gripper, as a skill commands and reads it."""

    def __init__(self, context: Context, side: Side) -> None:
        """Speak for the hand on `side`."""
        self._context = context
        self._side: Side = side

    @property
    def status(self) -> HandStatus:
        """What the hand's controller reports now.

        Raises:
            StageFailed: it has not reported yet.
        """
        status = self._context.bus.latest(topics.hand_status(self._side))
        if status is None:
            raise StageFailed("grasp", "hand", f"The {self._side} hand does not report.")
        return status

    def open(self, gap: float) -> None:
        """Move the fingers to an opening of `gap` [m]."""
        self._context.publish(topics.hand_goal(self._side), HandGoal(gap))

    def close(self, force: float) -> None:
        """Close until both fingers press with `force` [N]."""
        self._context.publish(topics.hand_goal(self._side), HandGoal(None, force))
