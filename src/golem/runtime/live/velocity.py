"""Velocities from outside: a joystick, a planner."""

from __future__ import annotations

from collections.abc import Callable

from golem.middleware import topics
from golem.middleware.bus import Bus
from golem.types import Twist

LET_GO = 0.5
"""Silence after which a velocity is of a new intention [s]."""


class Velocities:
    """Passes velocities on, unless whoever sends them began while the robot was not to be driven.

    A joystick that is held while the robot is stopped, or a planner that runs on, would else set it in motion the
    moment it is released. They have to let go first: send zero, or nothing for `LET_GO`.
    """

    def __init__(self, bus: Bus, now: Callable[[], float], closed: Callable[[], bool]) -> None:
        """Publish on `bus`, at time `now()` [s], what comes while not `closed()`."""
        self._bus, self._now, self._closed = bus, now, closed
        self._heard = -LET_GO
        self._held = False

    def take(self, twist: Twist) -> None:
        """Pass `twist` on, or not."""
        t, still = self._now(), twist == Twist()
        # A robot that was started anew begins its time anew.
        if still or not 0.0 <= t - self._heard <= LET_GO:
            self._held = False
        self._heard = t
        closed = self._closed()
        self._held |= closed and not still
        if not (closed or self._held):
            self._bus.publish(topics.TWIST, twist, t)
