"""Looks on while a robot picks, and remembers the decisive moments as they really were."""

from __future__ import annotations

import math

import numpy as np

from golem.evaluation.base import DONE
from golem.evaluation.episodes.errand_watch import ErrandWatch
from golem.evaluation.episodes.oracle import GraspTruth, Oracle
from golem.evaluation.episodes.pick_touches import PickTouches
from golem.interfaces import topics
from golem.interfaces.payloads import HandGoal
from golem.robots.mujoco.balance import BalanceRecorder
from golem.runtime.lockstep import LockstepRunner
from golem.types import Array, Side

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
        """Look at what `running` does, through `oracle`."""
        super().__init__(running, oracle, recorder)
        self._touches = touches
        self.grasp: GraspTruth | None = None
        self.pull: list[Array] = []
        self.looked_at: dict[int, Array] = {}
        self.drop_inside: float | None = None
        self._side: Side = "right"
        self._attempt = 0
        self._stage = ""
        self._servoed = False

    def due(self) -> float:
        """Return when it has to look again [s]; the way of a hand that pulls is kept by the tick."""
        return -math.inf if self._stage == "extract" else min(super().due(), self._touches.due())

    def __call__(self) -> None:
        """Look on."""
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
            self._servoed = False
        self._servoed = self._servoed or feedback.stage == "servo"
        if feedback.stage in LOOKING:
            # What it looks at is as far from the true hand as it believes it to be from the hand.
            looked = np.subtract(feedback.data["target"], feedback.data["hand"]) if "hand" in feedback.data else 0.0
            if self._attempt not in self.looked_at or "hand" in feedback.data:
                self.looked_at[self._attempt] = self._oracle.gripper(self._side)[:3, 3] + looked
        if feedback.stage == "grasp" and not feedback.data.get("failed"):
            # Where it servoed, the camera in the palm sent the hand, else that of the head.
            camera = f"{self._side}_hand" if self._servoed else "head"
            self.grasp = self._oracle.grasp(self._side, self._running.commanded(self._side), camera)
        if feedback.stage == DONE or feedback.data.get("failed"):
            self.picture = self._oracle.picture()
