"""What a robot that picks touches besides floor and screws, and how hard: the simulator's truth, for judges."""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco
import numpy as np

from golem.evaluation.episodes.contacts import FLOOR
from golem.evaluation.episodes.pick_claims import Fastener
from golem.robots.model.magpie_model import hand_name
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.engine import MujocoRobot
from golem.types import SIDES, Array

SURROUNDINGS = 0.04
"""What is this near to a fastener is its surroundings, which fingers may touch [m]."""


class PickTouches:
    """Collects what is touched; call it after every tick.

    Attributes:
        itself: pairs of links of the robot that touched each other; fingers of one hand may.
        world: links that touched pack, tray or anything else, away from the fasteners.
        force: largest force of a contact with any of that, the fasteners' surroundings included [N].
    """

    def __init__(self, robot: MujocoRobot, fasteners: Sequence[Fastener], T_world_odom: Array) -> None:
        """Watch `robot` among `fasteners`; `T_world_odom` is (4, 4)."""
        model = robot.scene.model
        self._robot, self._model = robot, model
        mine = (model.body_rootid == model.body(BASE_LINK).id)[model.geom_bodyid]
        hands = {side: model.body(hand_name(side)).id for side in SIDES}
        self._hand = np.zeros(model.ngeom, int)
        for number, root in enumerate(hands.values(), start=1):
            within = np.zeros(model.nbody, bool)
            within[root] = True
            for body in range(root + 1, model.nbody):
                within[body] = within[model.body_parentid[body]]
            self._hand[within[model.geom_bodyid]] = number
        screws = {model.body(name).id for name in robot.scene.names.screws}
        ignored = np.array([model.geom(i).name == FLOOR for i in range(model.ngeom)])
        ignored |= np.isin(model.geom_bodyid, list(screws))
        self._mine, self._ignored = mine, ignored
        # A contact counts if one of its two is the robot's, 1, and none is ignored, 8.
        self._told = robot.watch_contacts(np.where(ignored, 8, mine).astype(np.int64))
        spots = np.array([f.position for f in fasteners]).reshape(-1, 3)
        self._spots = spots @ T_world_odom[:3, :3].T + T_world_odom[:3, 3]
        self._force: Array = np.zeros(6)
        self.itself: set[str] = set()
        self.world: set[str] = set()
        self.force = 0.0

    def due(self) -> float:
        """Return when it has to look again [s]: after every tick, unless the robot tells of contacts."""
        return math.inf if self._told else -math.inf

    def __call__(self) -> None:
        """Look now."""
        contact = self._robot.data.contact
        pairs = contact.geom
        if not len(pairs):
            return
        mine = self._mine[pairs]
        counts = mine.any(axis=1) & ~self._ignored[pairs].any(axis=1)
        for i in np.flatnonzero(counts).tolist():
            own, other = pairs[i] if mine[i, 0] else pairs[i][::-1]
            names = [self._model.body(self._model.geom_bodyid[g]).name for g in (own, other)]
            if mine[i].all():
                if self._hand[own] == 0 or self._hand[own] != self._hand[other]:
                    self.itself.add(" on ".join(sorted(names)))
                continue
            mujoco.mj_contactForce(self._model, self._robot.data, i, self._force)
            self.force = max(self.force, float(np.linalg.norm(self._force[:3])))
            away = np.linalg.norm(self._spots - contact.pos[i], axis=1)
            if not len(away) or away.min() > SURROUNDINGS:
                self.world.add(names[0])

    def series(self) -> dict[str, float]:
        """Return the figures of the trial."""
        return {"self_contacts": float(len(self.itself)), "touches": float(len(self.world)), "touch_force": self.force}
