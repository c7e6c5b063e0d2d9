"""Looks on while a robot picks, and remembers the decisive moments and what was touched as they really were."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from golem.evaluation.base import DONE
from golem.evaluation.episodes.counter_watch import ErrandWatch
from golem.evaluation.episodes.oracle import FLOOR, GraspTruth, Oracle
from golem.evaluation.episodes.pick_claims import Fastener
from golem.interfaces import topics
from golem.interfaces.payloads import HandGoal
from golem.robots.model.magpie_model import hand_name
from golem.robots.model.table import BASE_LINK
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import LockstepRunner
from golem.types import SIDES, Array, Side

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


LOOKING = ("servo", "descend", "grasp")
"""Stages in which a hand is at an object that it has not moved yet."""


class PickWatch(ErrandWatch):
    """Looks on after every tick.

    Attributes:
        grasp: where hand and screw were when the fingers last began to close; None if they never did.
        pull: (4, 4) poses of the hand while it last pulled.
        looked_at: where what the hand looked at last really was, (3,) in odom [m], by the object's place in the pick's
            report.
        drop_inside: how far inside the tray's rim the hand was when it let go [m]; None if it never did.
    """

    def __init__(
        self, running: LockstepRunner, oracle: Oracle, recorder: BalanceRecorder | None, touches: PickTouches
    ) -> None:
        super().__init__(running, oracle, recorder)
        self._touches = touches
        self.grasp: GraspTruth | None = None
        self.pull: list[Array] = []
        self.looked_at: dict[int, Array] = {}
        self.drop_inside: float | None = None
        self._side: Side = "right"
        self._attempt = 0
        self._stage = ""
        self._servoed, self._aim, self._strayed = False, np.zeros(2), 0.0

    def due(self) -> float:
        """Return when it has to look again [s]; the way of a hand that pulls is kept by the tick."""
        return -math.inf if self._stage == "extract" else min(super().due(), self._touches.due())

    def __call__(self) -> None:
        self.look()
        self._touches()
        feedback = self._news.read()
        if self._stage == "extract":
            self.pull.append(self._oracle.gripper(self._side))
        if self._stage == "place" and self.drop_inside is None:
            goal: HandGoal | None = self._running.bus.latest(topics.hand_goal(self._side))
            if goal is not None and goal.gap is not None:
                self.drop_inside = self._oracle.inside_tray(self._side)
        if feedback is None:
            return
        if feedback.stage != self._stage:
            self._stage = feedback.stage
            self.pull = [] if self._stage == "extract" else self.pull
        if feedback.stage == "approach" and "side" in feedback.data:
            self._side, self._attempt = feedback.data["side"], feedback.data["attempt"] - 1
            self._servoed, self._aim, self._strayed = False, np.array(feedback.data["target"][:2]), 0.0
        self._servoed = self._servoed or feedback.stage == "servo"
        if feedback.stage in LOOKING:
            hand = self._oracle.gripper(self._side)[:3, 3]
            if "hand" in feedback.data:
                # What it looks at is as far from the true hand as it believes it to be from the hand.
                target = feedback.data["target"]
                self.looked_at[self._attempt] = hand + np.subtract(target, feedback.data["hand"])
                self._strayed = float(np.linalg.norm(target[:2] - self._aim))
            else:
                self.looked_at.setdefault(self._attempt, hand)
        if feedback.stage == "grasp" and not feedback.data.get("failed"):
            # Where it servoed, the camera in the palm sent the hand, else that of the head.
            camera = f"{self._side}_hand" if self._servoed else "head"
            looked_at = self.looked_at.get(self._attempt) if self._servoed else None
            grasp = self._oracle.grasp(self._side, self._running.commanded(self._side), camera, looked_at)
            self.grasp = replace(grasp, strayed=self._strayed)
        if feedback.stage == DONE or feedback.data.get("failed"):
            self.picture = self._oracle.picture()
