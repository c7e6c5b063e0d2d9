"""The pushes of the evaluation: the paper's rod at the pelvis, and short shoves against the torso."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from golem.robots.model.table import BASE_LINK
from golem.types import TICK, Array

DIRECTIONS = ("front", "front_left", "left", "back_left", "back", "back_right", "right", "front_right")
"""Where a push drives the robot, in its heading frame, in steps of 45 deg from straight ahead to the left."""
ROD_TIME = 1.0
"""Duration of a push with the rod [s]."""
SHOVE_TIME = 0.2
"""Duration of a shove [s]."""


@dataclass(frozen=True, slots=True)
class Push:
    """A horizontal force for a short time, in a direction that stays what it was when the push began.

    Attributes:
        body: link it acts on.
        point: where on the link, in its frame [m]; None is its centre of mass.
        direction: name in `DIRECTIONS`.
        peak: largest force [N].
        duration: how long [s].
        shape: constant, half a sine, or a ramp up to the peak.
    """

    body: str
    point: tuple[float, float, float] | None
    direction: str
    peak: float
    duration: float
    shape: Literal["constant", "half_sine", "ramp"]

    def force(self, elapsed: float, yaw: float) -> Array:
        """Return the (3,) force in the world [N], `elapsed` [s] after the push began at a heading of `yaw` [rad]."""
        if not 0.0 <= elapsed < self.duration:
            return np.zeros(3)
        share = elapsed / self.duration
        size = self.peak * {"constant": 1.0, "half_sine": math.sin(math.pi * share), "ramp": share}[self.shape]
        angle = yaw + self.bearing
        return size * np.array([math.cos(angle), math.sin(angle), 0.0])

    @property
    def bearing(self) -> float:
        """Its direction in the robot's heading frame [rad]."""
        return DIRECTIONS.index(self.direction) * math.pi / 4

    @property
    def impulse(self) -> float:
        """Its impulse [N s]."""
        return self.peak * self.duration * {"constant": 1.0, "half_sine": 2.0 / math.pi, "ramp": 0.5}[self.shape]


def rod(direction: str, peak: float) -> Push:
    """Return a push with the paper's rod: half a sine of `ROD_TIME` at the pelvis, up to `peak` [N].

    The paper's rod is moved by a person, who pushes until the robot yields; the force's course is not published.
    """
    return Push(BASE_LINK, (0.0, 0.0, 0.0), direction, peak, ROD_TIME, "half_sine")


def ramp(direction: str, peak: float, duration: float) -> Push:
    """Return a push with the same rod that grows evenly to `peak` [N] in `duration` [s], or until it is taken away."""
    return Push(BASE_LINK, (0.0, 0.0, 0.0), direction, peak, duration, "ramp")


def shove(direction: str, impulse: float) -> Push:
    """Return a constant force on the torso for `SHOVE_TIME` that transfers `impulse` [N s]."""
    return Push("torso_link", None, direction, impulse / SHOVE_TIME, SHOVE_TIME, "constant")


class Pushable(Protocol):
    """A simulated robot that can be pushed; see `MujocoRobot.push`."""

    def push(self, force: Array, body: str, point: Array | None) -> None:
        """Push a link from outside."""


class Pusher:
    """Pushes one twin, one push at a time; `force` (3,) is the present one in the world [N]."""

    def __init__(self, robot: Pushable) -> None:
        self._robot = robot
        self._push: tuple[Push, float, float] | None = None
        self.force: Array = np.zeros(3)

    def begin(self, push: Push, t: float, yaw: float) -> None:
        """Begin `push` at time `t` [s], when the robot's heading is `yaw` [rad]; it replaces one that goes on."""
        self.end()
        self._push = (push, t, yaw)
        self.drive(t)

    def end(self) -> None:
        """Take the push away that goes on, if one does."""
        if self._push is not None:
            self._apply(self._push[0], np.zeros(3))
        self._push = None

    @property
    def due(self) -> float:
        """When `drive` has to be called next [s]: at once while a push goes on."""
        return math.inf if self._push is None else -math.inf

    def drive(self, t: float) -> None:
        """Apply the push for the tick that begins at `t` [s]; call it at every tick."""
        if self._push is None:
            return
        push, start, yaw = self._push
        elapsed = t - start + 0.5 * TICK
        self._apply(push, push.force(elapsed, yaw))
        if elapsed > push.duration:
            self._push = None

    def _apply(self, push: Push, force: Array) -> None:
        self.force = force
        self._robot.push(force, push.body, None if push.point is None else np.array(push.point))
