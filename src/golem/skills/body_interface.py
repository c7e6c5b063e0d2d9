"""Grippers, joints, legs and the navigator, as a skill commands and reads them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np

from golem.capabilities.arms.trajectory import check_trajectory
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.nav_payloads import NavGoal, NavStep
from golem.interfaces.payloads import GateState, HandGoal, HandStatus, JointTrajectory, LegStatus
from golem.skills.base import StageFailed
from golem.types import Array, PlanarPose, Side, Twist

if TYPE_CHECKING:
    from golem.skills.context import Context


class Navigation:
    """The navigator drives the legs to a goal while this is open (a context manager); then the robot stands."""

    def __init__(self, context: Context, goal: PlanarPose, frame: Literal["odom", "map"] = "odom") -> None:
        self._context, self._goal = context, goal
        self._frame: Literal["odom", "map"] = frame
        self._seen = 0

    def __enter__(self) -> Navigation:
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

        Raises StageFailed: the odometry has fallen silent, or the robot's place in the map is not known.
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
        self._context = context
        self._side: Side = side

    @property
    def status(self) -> HandStatus:
        """What the hand's controller reports now. Raises StageFailed: it has not reported yet."""
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


ODOMETRY_TIMEOUT = 0.5
"""Age of the newest odometry from which on it says nothing about where the robot is [s]."""
HEIGHT_STEP, CLOSE = 0.06, 1e-5
"""Distance of heights that are tried, and of such that are one [m]."""
RISE, SETTLE = 8.0, 1.0
"""Time that the legs get to come to a height, and to come to rest there [s]."""


class LegsInterface:
    """The lower body, as a skill commands and reads it."""

    def __init__(self, context: Context) -> None:
        self._context = context

    @property
    def reporting(self) -> bool:
        """Whether they have said anything yet."""
        return self._context.bus.latest(topics.LEG_STATUS) is not None

    @property
    def status(self) -> LegStatus:
        """What the base layer of the legs reports now. Raises StageFailed: it has not reported yet."""
        status = self._context.bus.latest(topics.LEG_STATUS)
        if status is None:
            raise StageFailed("walk", "lower_body", "The legs do not report.")
        return status

    @property
    def pose(self) -> Array:
        """(4, 4) pose of base_link in odom by odometry, or by the base estimate. Raises StageFailed: it is silent."""
        odometry = self._context.bus.latest(topics.ODOMETRY)
        if odometry is not None and self._context.t - odometry.t > ODOMETRY_TIMEOUT:
            age = self._context.t - odometry.t
            why = self.silence or "Its sensors have fallen silent."
            raise StageFailed("walk", "odometry", f"The odometry has been silent for {age:.1f} s: {why}")
        return self._context.T_odom_base if odometry is None else odometry.T_odom_base

    @property
    def silence(self) -> str:
        """Why the odometry does not know where the robot is, as a sentence; empty where it knows, or there is none."""
        silence = self._context.bus.latest(topics.ODOMETRY_SILENCE)
        return "" if silence is None else silence.why

    def check_walking(self) -> None:
        """Check that these are legs that can walk. Raises ConfigError: they cannot; StageFailed: they do not report."""
        legs = self.status
        if legs.speed == 0.0:
            raise ConfigError(
                f"The legs, '{legs.controller}', do not walk; give the stack a lower_body that does, such as almi."
            )

    def check_located(self) -> None:
        """Check that an odometry that this stack has knows where the robot is. Raises StageFailed: it does not."""
        if self.silence:
            raise StageFailed("locate", "odometry", f"The odometry does not know where the robot is: {self.silence}")

    @property
    def doubt(self) -> str:
        """How far off the odometry believes its place to be, as the end of a sentence; empty where it does not say."""
        odometry = self._context.bus.latest(topics.ODOMETRY)
        if odometry is None or odometry.covariance is None:
            return ""
        place = math.sqrt(max(0.0, float(np.linalg.eigvalsh(odometry.covariance[:2, :2])[-1])))
        turn = math.degrees(math.sqrt(max(0.0, float(odometry.covariance[5, 5]))))
        return f", by an odometry that is sure of its place to {100.0 * place:.1f} cm and {turn:.1f} deg"

    @property
    def drops(self) -> tuple[float, ...]:
        """How much lower than now the robot may stand [m], its own height first; zero where the legs take none."""
        if not self.reporting or (heights := self.status.heights) is None:
            return (0.0,)
        low, own, high = heights
        down, up = np.arange(own, low, -HEIGHT_STEP), np.arange(own + HEIGHT_STEP, high, HEIGHT_STEP)
        return tuple(np.round(self.height - np.array([*down, low, *up]), 6).tolist())

    @property
    def height(self) -> float:
        """That of base_link above the ground [m], as it is commanded; 0 where the legs take none."""
        status = self.status
        return status.height or (status.heights or (0.0, 0.0))[1]

    async def stand_at(self, height: float) -> None:
        """Stand at a `height` of base_link above the ground [m], and wait until the robot does; it stays there.

        Raises:
            ConfigError: the legs in charge do not take it.
            StageFailed: they do not come to it.
        """
        name, heights = self.status.controller, self.status.heights
        if heights is None or not heights[0] - CLOSE <= height <= heights[2] + CLOSE:
            takes = "no height" if heights is None else f"heights from {heights[0]:g} to {heights[2]:g} m"
            raise ConfigError(f"The legs, '{name}', take {takes}, not {height:g} m.")
        self.drive(Twist(height=height))
        if not await self._context.until(lambda: abs(self.height - height) < CLOSE, RISE):
            raise StageFailed("stand", "lower_body", f"Not at {height:g} m after {RISE:g} s: {self.status.reason}.")
        await self._context.sleep(SETTLE)

    def drive(self, twist: Twist) -> None:
        """Move the base with `twist`; it has to be repeated every 0.5 s, or the robot stands."""
        self._context.publish(topics.TWIST, twist)
