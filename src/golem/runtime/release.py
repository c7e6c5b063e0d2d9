"""Lets the band of a robot that stands go: the operator's act at the end of every start on the ground."""

from __future__ import annotations

import numpy as np

from golem.capabilities.legs.base import LegCommand
from golem.middleware import topics
from golem.middleware.bus import Bus
from golem.robots.base import Banded
from golem.runtime.guard import Guard
from golem.runtime.nodes import moving

READY = 1.6
"""Time from the gate's activation to the release [s]: the servo's ramp, after which the arms hang still, and a bit."""


class ReleaseNode:
    """Releases the band once the gate is active, the servo stiff, and a leg controller at work."""

    period = 0.01

    def __init__(self, bus: Bus, robot: Banded, guard: Guard) -> None:
        """Watch `bus` for `robot`."""
        self._bus, self._robot, self._guard = bus, robot, guard
        self._waiting_since = 0.0

    def step(self, t: float) -> None:
        """Release the band when all is ready; a stop before that starts the wait anew."""
        if not self._robot.banded:
            return
        legs = self._bus.latest(topics.LEG_COMMAND, LegCommand)
        if not moving(self._bus) or legs is None or not (legs.kp.any() or np.any(legs.tau)):
            self._waiting_since = t
        elif t - self._waiting_since >= READY:
            self._guard.call(self._robot.release)
