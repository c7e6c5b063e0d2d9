"""The local controller: the twist that brings the robot along its way, sideways where that helps, and into nothing."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from golem.capabilities.navigation.footprint import Footprint
from golem.capabilities.navigation.rollout import HIT, score
from golem.capabilities.navigation.way import Way
from golem.options import require
from golem.types import Array, PlanarPose, Twist, wrap


@dataclass(frozen=True, slots=True)
class LocalControllerConfig:
    """Options of the local controller.

    Attributes:
        forward, backward, sideways: greatest speeds [m/s].
        turn: greatest rate of turning [rad/s].
        look: distance ahead on the way that it aims at [m].
        horizon: time over which a twist is tried [s].
        yields: time up to which nobody shall walk into it where it then stands [s].
        margin: distance from obstacles that the footprint keeps [m]: the body sways by some centimetres.
        slow: distance from obstacles within which the robot is slower [m].
    """

    forward: float = 0.6
    backward: float = 0.2
    sideways: float = 0.25
    turn: float = 0.5
    look: float = 1.1
    horizon: float = 1.6
    yields: float = 2.4
    margin: float = 0.06
    slow: float = 0.35

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            ConfigError: one of them cannot be meant.
        """
        names = ("forward", "backward", "sideways", "turn", "look", "horizon", "yields", "margin", "slow")
        rows = ((name, getattr(self, name)) for name in names)
        require("local option ", *((n, v, 0.0 < v < math.inf, "a positive number") for n, v in rows))


NOBODY: Array = np.zeros((0, 5))
"""People of whom there are none."""
GAIN = 0.05
"""Distance from people that evading must win [m]."""
STEP = 0.2
"""Time between two places at which a twist is tried [s]."""
WEIGHTS = (1.0, 0.5, 0.03)
"""Of a metre from the aim, a radian off its heading, and of one over the clearance [m] [own]."""


class LocalController:
    """Chooses among twists by what they lead to; see `rollout.score`."""

    def __init__(self, config: LocalControllerConfig) -> None:
        """Prepare the twists that are tried."""
        self.config = config
        c = config
        vx = [-c.backward, 0.0, *(share * c.forward for share in (0.25, 0.5, 0.75, 1.0))]
        vy = [share * c.sideways for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        wz = [share * c.turn for share in (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)]
        # An ellipse: legs that go at full speed ahead do not go at full speed sideways as well.
        self._twists: Array = np.array(
            [
                t
                for t in itertools.product(vx, vy, wz)
                if (t[0] / c.forward) ** 2 + (t[1] / c.sideways) ** 2 < 1.3 and t != (0.0, 0.0, 0.0)
            ]
        )

    def follow(
        self,
        pose: PlanarPose,
        way: Way,
        goal: PlanarPose,
        footprint: Footprint,
        clearance: Array,
        frame: Array,
        people: Array = NOBODY,
    ) -> Twist | None:
        """Return the best twist, or one out of the way of people; None where each leads into an obstacle.

        Args:
            pose: of base_link in the frame of the map.
            way: where to go.
            goal: where that ends.
            footprint: of the robot.
            clearance: of the window around the robot, see `rollout.score`.
            frame: of that window.
            people: those who walk, likewise.
        """
        i, _ = way.nearest(pose)
        left = way.left(i)
        ahead = way.ahead(i, self.config.look)
        heading = goal.yaw if left < self.config.look else math.atan2(ahead.y - pose.y, ahead.x - pose.x)
        turn = wrap(heading - pose.yaw)
        # Towards the goal it goes as fast as it can stop; facing away it turns before it walks.
        fastest = min(self.config.forward, max(0.2, 0.8 * left))
        fastest *= max(0.25, math.cos(min(abs(turn), math.pi / 2)))
        room = self.room(pose, footprint, clearance, frame)
        if room < self.config.slow:
            fastest *= max(0.35, room / self.config.slow)
        twists = self._twists * np.array([fastest / self.config.forward, 1.0, 1.0])
        aim = np.array([ahead.x, ahead.y, heading])
        scores, _, _ = self._score(twists, pose, footprint, clearance, frame, people, aim)
        best = int(scores.argmin())
        if scores[best] < HIT / 2:
            return Twist(*(float(v) for v in twists[best]))
        return self._evaded(pose, footprint, clearance, frame, people)

    def _evaded(
        self, pose: PlanarPose, footprint: Footprint, clearance: Array, frame: Array, people: Array
    ) -> Twist | None:
        """Return the twist that leaves those who come most room; None where standing is as good."""
        if not len(people):
            return None
        twists, here = np.vstack([self._twists, np.zeros(3)]), np.array([pose.x, pose.y, pose.yaw])
        _, hits, spare = self._score(twists, pose, footprint, clearance, frame, people, here)
        best = int(spare.argmax())
        if not np.isfinite(hits[-1]) or spare[best] < spare[-1] + GAIN:
            return None
        return Twist(*(float(v) for v in twists[best]))

    def clear(
        self,
        twist: Twist,
        pose: PlanarPose,
        footprint: Footprint,
        clearance: Array,
        frame: Array,
        people: Array = NOBODY,
    ) -> bool:
        """Return whether a twist leads into no obstacle within the horizon; arguments as for `follow`."""
        twists, here = np.array([[twist.vx, twist.vy, twist.wz]]), np.array([pose.x, pose.y, pose.yaw])
        _, hits, _ = self._score(twists, pose, footprint, clearance, frame, people, here)
        return not np.isfinite(hits[0])

    def room(self, pose: PlanarPose, footprint: Footprint, clearance: Array, frame: Array) -> float:
        """Return the distance of the footprint from the nearest obstacle [m]."""
        u = footprint.at(pose) - frame[:2]
        column = np.floor((frame[2] * u[:, 0] + frame[3] * u[:, 1]) / frame[4]).astype(int)
        row = np.floor((frame[2] * u[:, 1] - frame[3] * u[:, 0]) / frame[4]).astype(int)
        rows, columns = clearance.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return float(clearance[row[inside], column[inside]].min(initial=10.0))

    def _score(
        self,
        twists: Array,
        pose: PlanarPose,
        footprint: Footprint,
        clearance: Array,
        frame: Array,
        people: Array,
        aim: Array,
    ) -> tuple[Array, Array, Array]:
        scores, hits, spare = (np.empty(len(twists)) for _ in range(3))
        score(
            twists,
            np.array([pose.x, pose.y, pose.yaw]),
            footprint.samples,
            clearance,
            frame,
            people,
            aim,
            np.array([*WEIGHTS, self.config.margin]),
            np.array([self.config.horizon, STEP, self.config.yields]),
            scores,
            hits,
            spare,
        )
        return scores, hits, spare
