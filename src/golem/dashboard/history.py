"""The last minute of a live view: where everything was, and what the robot measured."""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.model.table import JOINT_NAMES
from golem.types import Array

SPAN = 60.0
"""Time that is kept [s]."""
QUANTITIES = {"angle [rad]": "q", "speed [rad/s]": "dq", "torque [N m]": "tau"}
"""What is kept of every joint, and where the motors' state has it."""
BALANCE = "CoM margin [m], simulator's truth"
HEIGHT = "height of base_link [m], estimate"
SIGNALS = (*(f"{joint.removesuffix('_joint')}, {w}" for w in QUANTITIES for joint in JOINT_NAMES), BALANCE, HEIGHT)
"""What can be plotted."""


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One moment.

    Attributes:
        t: robot time [s].
        positions, orientations: (n, 3) [m] and (n, 4) wxyz of the moving bodies in the world.
        signals: (s,) values of `SIGNALS`; NaN for what is not known.
    """

    t: float
    positions: Array
    orientations: Array
    signals: Array


class History:
    """Moments of the last `SPAN` seconds, in order."""

    def __init__(self) -> None:
        self._moments: deque[Snapshot] = deque()

    def add(self, moment: Snapshot) -> None:
        """Keep a moment that is later than those before."""
        self._moments.append(moment)
        while self._moments[0].t < moment.t - SPAN:
            self._moments.popleft()

    def before(self, age: float) -> Snapshot | None:
        """Return the newest moment that is at least `age` [s] older than the newest of all, or the oldest."""
        if not self._moments:
            return None
        i = bisect_right(self._moments, self._moments[-1].t - age, key=lambda moment: moment.t)
        return self._moments[max(i - 1, 0)]

    def trace(self, signal: str) -> tuple[Array, Array]:
        """Return (n,) times relative to the newest [s], and (n,) values of a signal."""
        column = SIGNALS.index(signal)
        times = np.array([moment.t for moment in self._moments])
        return times - times[-1:], np.array([moment.signals[column] for moment in self._moments])


def read_signals(bus: Bus, margin: float) -> Array:
    """Return (s,) the present values of `SIGNALS`; `margin` is the CoM's [m]."""
    state, base = bus.latest(topics.LOW_STATE), bus.latest(topics.BASE)
    n = len(JOINT_NAMES)
    joints = [np.full(n, np.nan) if state is None else getattr(state, name) for name in QUANTITIES.values()]
    return np.concatenate((*joints, (margin, np.nan if base is None else base.height)))
