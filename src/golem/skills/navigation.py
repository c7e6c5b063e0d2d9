"""A skill's way to a goal pose, which the stack's navigator finds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavGoal, NavStep
from golem.types import PlanarPose, Twist

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
