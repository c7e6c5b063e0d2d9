"""What a simulated robot touches besides the floor: the simulator's truth, for judges."""

from __future__ import annotations

import math

import numpy as np

from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.engine import MujocoRobot

FLOOR = "floor"
"""Name of the geom that a robot may touch with its feet."""


class ContactWatch:
    """Collects what the robot touched; call it after every tick.

    Attributes:
        touched: `LINK on BODY` of every pair that was in contact, with the time of the first [s].
        places: where that was in the world, (3,) each [m].
    """

    def __init__(self, robot: MujocoRobot) -> None:
        model = robot.scene.model
        self._robot = robot
        mine = (model.body_rootid == model.body(BASE_LINK).id)[model.geom_bodyid]
        floor = np.array([model.geom(i).name == FLOOR for i in range(model.ngeom)])
        # 1 for what is the robot's, 8 for what it may touch with its feet, 0 for the rest.
        kinds = np.where(floor, 8, mine).astype(np.int64)
        self._kind: list[int] = kinds.tolist()
        self._told = robot.watch_contacts(kinds)
        self.touched: dict[str, float] = {}
        self.places: dict[str, tuple[float, float, float]] = {}

    def due(self) -> float:
        """Return when it has to look again [s]: after every tick, unless the robot tells of contacts."""
        return math.inf if self._told else -math.inf

    def __call__(self, t: float) -> None:
        """Look at time `t` [s]."""
        contact, kind = self._robot.data.contact, self._kind
        for i, pair in enumerate(contact.geom.tolist()):
            if kind[pair[0]] + kind[pair[1]] != 1:
                continue
            own, other = pair if kind[pair[0]] else pair[::-1]
            model = self._robot.scene.model
            names = [model.body(model.geom_bodyid[g]).name for g in (own, other)]
            touch = " on ".join(names)
            if touch not in self.touched:
                self.touched[touch] = t
                x, y, z = contact.pos[i].tolist()
                self.places[touch] = (x, y, z)
