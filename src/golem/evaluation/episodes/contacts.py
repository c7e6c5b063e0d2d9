"""What a simulated robot touches besides the floor: the simulator's truth, for judges."""

from __future__ import annotations

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
        """Watch `robot`."""
        model = robot.scene.model
        self._robot = robot
        self._mine = (model.body_rootid == model.body(BASE_LINK).id)[model.geom_bodyid]
        self._floor = np.array([model.geom(i).name == FLOOR for i in range(model.ngeom)])
        self.touched: dict[str, float] = {}
        self.places: dict[str, tuple[float, float, float]] = {}

    def __call__(self, t: float) -> None:
        """Look at time `t` [s]."""
        contact = self._robot.data.contact
        pairs = contact.geom
        if not len(pairs):
            return
        mine = self._mine[pairs]
        foreign = mine[:, 0] ^ mine[:, 1]
        foreign &= ~self._floor[pairs].any(axis=1)
        for i in np.flatnonzero(foreign).tolist():
            own, other = pairs[i] if mine[i, 0] else pairs[i][::-1]
            model = self._robot.scene.model
            names = [model.body(model.geom_bodyid[g]).name for g in (own, other)]
            pair = " on ".join(names)
            if pair not in self.touched:
                self.touched[pair] = t
                x, y, z = contact.pos[i].tolist()
                self.places[pair] = (x, y, z)
