"""Looks on while a robot works at a counter: what was lifted, where it stands at the end, what else was moved."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.evaluation.episodes.oracle import Oracle
from golem.interfaces import topics
from golem.middleware.bus import News
from golem.robots.mujoco.balance import BalanceRecorder
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import LockstepRunner
from golem.types import Array


class ErrandWatch:
    """Looks on after every tick; one of it reads what the skill says, and keeps the decisive picture.

    Attributes:
        recorder: follows the balance; None for a robot that hangs.
        picture: PNG of the decisive moment; None where it has not come.
    """

    def __init__(self, running: LockstepRunner, oracle: Oracle, recorder: BalanceRecorder | None) -> None:
        self._running, self._oracle, self.recorder = running, oracle, recorder
        self._news = News(running.bus, topics.FEEDBACK)
        self.picture: bytes | None = None

    def look(self) -> bool:
        """Look on after the errand; it is never a reason to end."""
        if self.recorder is not None:
            self.recorder(self._running.executor.t)
        return False

    def due(self) -> float:
        """Return when it has to look again [s], at the latest."""
        return math.inf if self.recorder is None else self.recorder.due

    def last_picture(self) -> bytes:
        """Return the picture of the decisive moment; else of now."""
        return self.picture or self._oracle.picture()


LIFTED = 0.05
"""Height from which on a thing counts as lifted [m]."""
THERE = 0.06
"""Distance from the place within which it counts as set down there [m]: somewhat less than its width."""
LEVEL = 0.04
"""How far its underside may be above the counter [m]; on top of another thing it is more."""
UPRIGHT = 0.26
"""How far it may lean [rad]: 15 deg."""
MOVED = 0.05
"""How far others may have been moved [m]."""
PICTURED = ("release", "done")


@dataclass(frozen=True, slots=True)
class StandingOne:
    """How a thing stands: kind, (3,) middle of its underside in the world [m], and how far it leans [rad]."""

    kind: str
    position: Array
    lean: float


class CounterWatch(ErrandWatch):
    """Call it after every tick of an errand. Its picture is of when a thing was let go, or a stage failed."""

    def __init__(self, running: LockstepRunner, robot: MujocoRobot, oracle: Oracle, kind: str, balances: bool) -> None:
        """Look at the things as they stand now; one of `kind` is to be taken."""
        assert robot.scene.kitchen is not None
        super().__init__(running, oracle, BalanceRecorder(robot) if balances else None)
        self._robot, self._kind = robot, kind
        self._names = tuple((thing.kind, thing.body) for thing in robot.scene.kitchen.things)
        self._bodies = [robot.data.body(body).id for _, body in self._names]
        self._before = self._things()
        self._highest = np.array([thing.position[2] for thing in self._before])

    def __call__(self) -> None:
        self.look()
        feedback = self._news.read()
        if feedback is not None and (feedback.stage in PICTURED or feedback.data.get("failed")):
            self.picture = self._oracle.picture()

    def look(self) -> bool:
        np.maximum(self._highest, self._robot.data.xpos[self._bodies, 2], out=self._highest)
        return super().look()

    def problem(self, place: tuple[float, float]) -> str | None:
        """Return what is not as asked for at `place`, x, y in the world [m], in a sentence; None where all is."""
        now, lifted = self._things(), self._lifted()
        if lifted is None:
            return f"No {self._kind} was lifted."
        one = now[lifted]
        off = float(np.hypot(*(one.position[:2] - place)))
        if one.lean > UPRIGHT:
            return f"The {self._kind} leans by {np.rad2deg(one.lean):.0f} deg."
        if off > THERE or abs(one.position[2] - self._before[lifted].position[2]) > LEVEL:
            return f"The {self._kind} is {1e2 * off:.0f} cm from its place."
        for k, (before, after) in enumerate(zip(self._before, now, strict=True)):
            moved = float(np.linalg.norm(after.position - before.position))
            if k != lifted and (moved > MOVED or after.lean > UPRIGHT):
                return f"The {after.kind} beside it was moved by {1e2 * moved:.0f} cm or knocked over."
        return None

    def astray(self, place: tuple[float, float]) -> bool:
        """Return whether one of the kind was lifted and stands upright at its height, but not at `place`."""
        now, lifted = self._things(), self._lifted()
        if lifted is None or now[lifted].lean > UPRIGHT:
            return False
        moved = now[lifted].position - self._before[lifted].position
        off = float(np.hypot(*(now[lifted].position[:2] - place)))
        return off > THERE and abs(float(moved[2])) <= LEVEL

    def series(self, place: tuple[float, float]) -> dict[str, float]:
        """Return how far from its place the thing stands, where it was lifted, and how far others were moved [m]."""
        now, lifted = self._things(), self._lifted()
        others = [pair for k, pair in enumerate(zip(self._before, now, strict=True)) if k != lifted]
        moved = [float(np.linalg.norm(b.position - a.position)) for a, b in others]
        series = {"others_moved": max(moved, default=0.0), "was_lifted": float(lifted is not None)}
        if lifted is not None:
            series["set_down_error"] = float(np.hypot(*(now[lifted].position[:2] - place)))
        return series

    def _lifted(self) -> int | None:
        """Return which thing of the kind was lifted, the first; None where none was."""
        mine = (k for k, thing in enumerate(self._before) if thing.kind == self._kind)
        return next((k for k in mine if self._highest[k] > self._before[k].position[2] + LIFTED), None)

    def _things(self) -> list[StandingOne]:
        found: list[StandingOne] = []
        for kind, name in self._names:
            body = self._robot.data.body(name)
            lean = float(np.arccos(np.clip(body.xmat[8], -1.0, 1.0)))
            found.append(StandingOne(kind, body.xpos.copy(), lean))
        return found
