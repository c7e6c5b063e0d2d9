"""Velocities from outside: a joystick, a planner."""

from __future__ import annotations

import math
from collections.abc import Callable

from golem.capabilities.legs.locomotion import LocomotionConfig
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.types import Twist

_LEGS = LocomotionConfig()
LET_GO = 2.0 * _LEGS.timeout
"""Silence after which a velocity is of a new intention [s]: twice the longest time in which one has to be repeated."""
STILL = _LEGS.dead_band
"""Size of (vx, vy, wz) below which nobody is asked to move [m/s, rad/s]: sticks are never quite at rest."""


class Velocities:
    """Passes velocities on, unless whoever sends them began while the robot was not to be driven.

    A joystick that is held while the robot is stopped, or a planner that runs on, would else set it in motion the
    moment it is released. They have to let go first: send less than `STILL`, or nothing for `LET_GO`. Who sends is not
    told apart: where two do, one of them lets go for both.
    """

    def __init__(self, bus: Bus, now: Callable[[], float], closed: Callable[[], bool]) -> None:
        """Publish on `bus`, at time `now()` [s], what comes while not `closed()`."""
        self._bus, self._now, self._closed = bus, now, closed
        self._heard = -LET_GO
        self._held = False

    def take(self, twist: Twist) -> None:
        """Pass `twist` on, or not."""
        t, still = self._now(), math.hypot(twist.vx, twist.vy, twist.wz) < STILL  # false for nan
        # A robot that was restarted begins its time anew.
        if still or not 0.0 <= t - self._heard <= LET_GO:
            self._held = False
        self._heard = t
        closed = self._closed()
        self._held |= closed and not still
        if not (closed or self._held):
            self._bus.publish(topics.TWIST, twist, t)
