"""The robot's time in a process that drives a device: what it measures is stamped as if the robot had done it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from golem.interfaces import public
from golem.interfaces.ros_convert import seconds
from golem.middleware.ros.node import RosNode

SILENCE = 0.2
"""Time without a /clock after which nobody knows the robot's time [s]."""


class RobotTime:
    """Turns this process's time into the robot's, by /clock."""

    def __init__(self, node: RosNode, clock: Callable[[], float]) -> None:
        """Listen to /clock through `node`; `clock` is this process's own [s]."""
        self._clock = clock
        self._newest: tuple[float, float] | None = None
        row = public.topic("/clock")
        node.subscription(row.name, row.type, self._take, row.qos)

    def at(self, t: float) -> float | None:
        """Return the robot's time at our time `t` [s]; None while no clock is heard."""
        if self._newest is None:
            return None
        robot, heard = self._newest
        return robot + t - heard if self._clock() - heard < SILENCE else None

    def _take(self, message: Any) -> None:
        self._newest = (seconds(message.clock), self._clock())
