"""A gantry that loosens one fastener after another beside the robot, and says which, as RAPID's cell does."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.worlds.layout import GANTRY
from golem.types import Array

REMOVAL = 20.0
"""Time from one fastener to the next [s]; RAPID took 24 minutes for 68 fasteners (arXiv 2603.18520)."""
SPEED, CLEAR = 0.25, 0.3
"""Speed of its tool [m/s], and height above a fastener at which it travels [m] [own]."""
PERIOD = 0.02
"""Time between two places of the tool [s]."""


class GantryCell:
    """Moves the twin's gantry; call it whenever it is due.

    Attributes:
        due: when it moves next [s].
    """

    def __init__(self, robot: MujocoRobot, bus: Bus, visits: Sequence[tuple[str, Array]], start: float) -> None:
        """Go to `visits`, names and places (3,) in the world [m], from the time `start` on [s], and back."""
        self._data, self._id = robot.data, int(robot.scene.model.body(GANTRY).mocapid[0])
        home: Array = robot.data.mocap_pos[self._id].copy()
        self._stops = [home, *(place for _, place in visits), home]
        self._bus, self._names, self._said = bus, [name for name, _ in visits], 0
        self._start, self.due = start, start

    def __call__(self, t: float) -> None:
        """Be where it is at time `t` [s], and say where it goes, before it goes there."""
        k = min(int((t - self._start) // REMOVAL), len(self._names))
        if self._said <= k < len(self._names):
            self._said = k + 1
            self._bus.publish(topics.REMOVALS, f"Remove: {self._names[k]} with confidence = 0.97", t)
        self._data.mocap_pos[self._id] = _between(self._stops[k], self._stops[k + 1], t - self._start - k * REMOVAL)
        self.due = t + PERIOD


def _between(here: Array, there: Array, t: float) -> Array:
    """Return (3,) where a tool is that goes up from `here`, across and down on `there`, `t` after it began [s]."""
    top = max(here[2], there[2]) + CLEAR
    via = np.array([here, (*here[:2], top), (*there[:2], top), there])
    ways = np.append(0.0, np.linalg.norm(np.diff(via, axis=0), axis=1).cumsum())
    return np.array([np.interp(SPEED * t, ways, via[:, axis]) for axis in range(3)])
