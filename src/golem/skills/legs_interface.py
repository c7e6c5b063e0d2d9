"""The lower body, as a skill commands and reads it, and where the robot is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from golem.errors import ConfigError
from golem.interfaces import topics
from golem.interfaces.payloads import LegStatus
from golem.skills.base import StageFailed
from golem.types import Array, Twist

if TYPE_CHECKING:
    from golem.skills.context import Context

ODOMETRY_TIMEOUT = 0.5
"""Age of the newest odometry from which on it says nothing about where the robot is [s]."""
HEIGHT_STEP = 0.06
"""Distance of heights that are tried [m]."""
RISE, SETTLE = 8.0, 1.0
"""Time that the legs get to come to a height, and to come to rest there [s]."""


class LegsInterface:
    """The lower body, as a skill commands and reads it."""

    def __init__(self, context: Context) -> None:
        """Speak for the legs."""
        self._context = context

    @property
    def reporting(self) -> bool:
        """Whether they have said anything yet."""
        return self._context.bus.latest(topics.LEG_STATUS) is not None

    @property
    def status(self) -> LegStatus:
        """What the base layer of the legs reports now.

        Raises:
            StageFailed: it has not reported yet.
        """
        status = self._context.bus.latest(topics.LEG_STATUS)
        if status is None:
            raise StageFailed("walk", "lower_body", "The legs do not report.")
        return status

    @property
    def pose(self) -> Array:
        """(4, 4) pose of base_link in odom by the odometry, or by the base estimate in a stack without one.

        Raises:
            StageFailed: the odometry has fallen silent.
        """
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

    def check_located(self) -> None:
        """Check that an odometry that this stack has knows where the robot is.

        Raises:
            StageFailed: it does not.
        """
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
        status = self._context.bus.latest(topics.LEG_STATUS)
        if status is None or status.heights is None:
            return (0.0,)
        low, own, high = status.heights
        now = own if status.height is None else status.height
        down, up = np.arange(own, low, -HEIGHT_STEP), np.arange(own + HEIGHT_STEP, high, HEIGHT_STEP)
        return tuple(np.round(now - np.array([*down, low, *up]), 6).tolist())

    async def lower(self, by: float) -> None:
        """Stand lower `by` [m], one of `drops`, and wait until the robot does; see `stand_at`."""
        status = self.status
        if status.heights is not None and by:
            await self.stand_at((status.heights[1] if status.height is None else status.height) - by)

    async def stand_at(self, height: float) -> None:
        """Stand at a `height` of base_link above the ground [m], and wait until the robot does; it stays there.

        Raises:
            ConfigError: the legs in charge do not take it.
            StageFailed: they do not come to it.
        """
        status, tolerance = self.status, 1e-6
        takes = "no height"
        if status.heights is not None:
            low, _, high = status.heights
            takes = "" if low - tolerance <= height <= high + tolerance else f"heights from {low:g} to {high:g} m"
        if takes:
            raise ConfigError(f"The legs, '{status.controller}', take {takes}, not {height:g} m.")
        self.drive(Twist(height=height))
        if not await self._context.until(lambda: abs((self.status.height or 0.0) - height) < tolerance, RISE):
            raise StageFailed("stand", "lower_body", f"Not at {height:g} m after {RISE:g} s: {self.status.reason}.")
        await self._context.sleep(SETTLE)

    def drive(self, twist: Twist) -> None:
        """Move the base with `twist`; it has to be repeated every 0.5 s, or the robot stands."""
        self._context.publish(topics.TWIST, twist)
