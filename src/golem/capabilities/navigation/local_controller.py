"""The local controller: the twist that brings the robot along its way, sideways where that helps, and into nothing.

Tries twists: where each leads within the next moments, and whether the footprint stays clear of what is there then.

The dynamic window approach (Fox, Burgard and Thrun, 1997) with three components of the twist. Obstacles stand; people
are where they will be at each moment, as with Seder and Petrovic (2007).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from golem.capabilities.navigation.astar import Way
from golem.capabilities.navigation.footprint import Footprint
from golem.kernels import njit
from golem.options import require
from golem.types import Array, PlanarPose, Twist, wrap

HIT = 1e9
"""Score of a twist that leads into an obstacle."""
DOUBT = 0.1
"""By how much more space somebody who walks needs per second that is looked ahead [m/s] [own]."""

NOBODY: Array = np.zeros((0, 5))
"""People of whom there are none."""


class Around(NamedTuple):
    """What is around the robot, in a map's frame.

    Attributes:
        clearance: (rows, columns) distance from the nearest obstacle [m].
        frame: (5,) x, y, cosine and sine of the corner of `clearance`, and its resolution [m].
        people: (k, 5) those who walk: place [m] and velocity [m/s], and radius [m].
    """

    clearance: Array
    frame: Array
    people: Array = NOBODY


@njit(cache=True, nogil=True, error_model="numpy")
def score(
    twists: Array,
    pose: Array,
    samples: Array,
    around: Around,
    aim: Array,
    weights: Array,
    horizon: Array,
    scores: Array,
    hits: Array,
    spare: Array,
) -> None:
    """Write the (n,) score of each twist, the lower the better, when it hits something, and how near people come.

    Args:
        twists: (n, 3) vx, vy, wz.
        pose: (3,) of base_link in the frame of the map.
        samples: (m, 2) places on the footprint's edge in base_link.
        aim: (3,) place to come near, and heading to have there, in the frame of the map.
        weights: (4,) per metre from the aim, per radian off its heading, of nearness, and the clearance that is asked
            for [m].
        horizon: (3,) time for which a twist is tried, step, and time up to which the robot that then stands shall have
            nobody walk into it [s].
        scores: (n,) written.
        hits: (n,) written: the time of the first contact [s], infinite without one.
        spare: (n,) written: the least distance of base_link from people [m], far below zero where the twist hits an
            obstacle.
    """
    clearance, frame, people = around.clearance, around.frame, around.people
    rows, columns = clearance.shape
    steps, last = int(round(horizon[0] / horizon[1])), int(round(horizon[2] / horizon[1]))
    for i in range(len(twists)):
        vx, vy, wz = twists[i, 0], twists[i, 1], twists[i, 2]
        x, y, yaw = pose[0], pose[1], pose[2]
        nearest, hits[i], spare[i] = 10.0, np.inf, 10.0
        first = beside = 10.0
        for step in range(max(steps, last if len(people) else 0) + 1):
            c, s, t = math.cos(yaw), math.sin(yaw), step * horizon[1]
            least = between = 10.0
            for j in range(len(samples)):
                at_x = x + c * samples[j, 0] - s * samples[j, 1]
                at_y = y + s * samples[j, 0] + c * samples[j, 1]
                for k in range(len(people)):
                    px, py = people[k, 0] + t * people[k, 2], people[k, 1] + t * people[k, 3]
                    between = min(between, math.hypot(at_x - px, at_y - py) - people[k, 4] - DOUBT * t)
                u, v = at_x - frame[0], at_y - frame[1]
                column = int(math.floor((frame[2] * u + frame[3] * v) / frame[4]))
                row = int(math.floor((frame[2] * v - frame[3] * u) / frame[4]))
                if 0 <= row < rows and 0 <= column < columns and clearance[row, column] < least:
                    least = clearance[row, column]
            if step == 0:
                first, beside = least, between
            # A robot that is too near already may go where it comes no nearer.
            elif least < weights[3] and least < first - 0.01:
                hits[i], spare[i] = min(hits[i], t), -10.0
                break
            elif between < weights[3] and between < beside - 0.01:
                hits[i] = min(hits[i], t)
            nearest = min(nearest, min(least, between))
            moves = horizon[1] if step <= steps else 0.0
            dx, dy = moves * (c * vx - s * vy), moves * (s * vx + c * vy)
            for k in range(len(people)):
                # Closest approach until the next step, seen from base_link.
                u, v = people[k, 0] + t * people[k, 2] - x, people[k, 1] + t * people[k, 3] - y
                du, dv = horizon[1] * people[k, 2] - dx, horizon[1] * people[k, 3] - dy
                square = du * du + dv * dv
                share = 0.0 if square == 0.0 else min(max(-(u * du + v * dv) / square, 0.0), 1.0)
                spare[i] = min(spare[i], math.hypot(u + share * du, v + share * dv) - people[k, 4])
            x, y, yaw = x + dx, y + dy, yaw + moves * wz
        if hits[i] < np.inf:
            scores[i] = HIT - hits[i]
            continue
        off = math.hypot(aim[0] - x, aim[1] - y)
        turn = abs(math.atan2(math.sin(aim[2] - yaw), math.cos(aim[2] - yaw)))
        scores[i] = weights[0] * off + weights[1] * turn + weights[2] / (0.1 + max(nearest, 0.0))


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
        names = ("forward", "backward", "sideways", "turn", "look", "horizon", "yields", "margin", "slow")
        rows = ((name, getattr(self, name)) for name in names)
        require("local option ", *((n, v, 0.0 < v < math.inf, "a positive number") for n, v in rows))


GAIN = 0.05
"""Distance from people that evading must win [m]."""
STEP = 0.2
"""Time between two places at which a twist is tried [s]."""
WEIGHTS = (1.0, 0.5, 0.03)
"""Of a metre from the aim, a radian off its heading, and of one over the clearance [m] [own]."""


class LocalController:
    """Chooses among twists by what they lead to; see `local_controller.score`."""

    def __init__(self, config: LocalControllerConfig) -> None:
        self.config = config
        c = config
        vx = [-c.backward, 0.0, *(share * c.forward for share in (0.25, 0.5, 0.75, 1.0))]
        vy = [share * c.sideways for share in (-1.0, -0.5, 0.0, 0.5, 1.0)]
        wz = [share * c.turn for share in (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)]
        # An ellipse: legs that go at full speed ahead do not go at full speed sideways as well.
        every = [t for t in itertools.product(vx, vy, wz) if t != (0.0, 0.0, 0.0)]
        able = [t for t in every if (t[0] / c.forward) ** 2 + (t[1] / c.sideways) ** 2 < 1.3]
        self._twists: Array = np.array(able)

    def follow(
        self, pose: PlanarPose, way: Way, goal: PlanarPose, footprint: Footprint, around: Around
    ) -> Twist | None:
        """Return the best twist at `pose` in the map, or one out of people's way; None if all end in obstacles."""
        i, _ = way.nearest(pose)
        left = way.left(i)
        ahead = way.ahead(i, self.config.look)
        heading = goal.yaw if left < self.config.look else math.atan2(ahead.y - pose.y, ahead.x - pose.x)
        turn = wrap(heading - pose.yaw)
        # Towards the goal it goes as fast as it can stop; facing away it turns before it walks.
        fastest = min(self.config.forward, max(0.2, 0.8 * left))
        fastest *= max(0.25, math.cos(min(abs(turn), math.pi / 2)))
        room = self.room(pose, footprint, around)
        if room < self.config.slow:
            fastest *= max(0.35, room / self.config.slow)
        twists = self._twists * np.array([fastest / self.config.forward, 1.0, 1.0])
        aim = np.array([ahead.x, ahead.y, heading])
        scores, _, _ = self._score(twists, pose, footprint, around, aim)
        best = int(scores.argmin())
        if scores[best] < HIT / 2:
            return Twist(*(float(v) for v in twists[best]))
        return self._evaded(pose, footprint, around)

    def _evaded(self, pose: PlanarPose, footprint: Footprint, around: Around) -> Twist | None:
        """Return the twist that leaves those who come most room; None where standing is as good."""
        if not len(around.people):
            return None
        twists, here = np.vstack([self._twists, np.zeros(3)]), np.array([pose.x, pose.y, pose.yaw])
        _, hits, spare = self._score(twists, pose, footprint, around, here)
        best = int(spare.argmax())
        if not np.isfinite(hits[-1]) or spare[best] < spare[-1] + GAIN:
            return None
        return Twist(*(float(v) for v in twists[best]))

    def clear(self, twist: Twist, pose: PlanarPose, footprint: Footprint, around: Around) -> bool:
        """Return whether a twist leads into no obstacle within the horizon; arguments as for `follow`."""
        twists, here = np.array([[twist.vx, twist.vy, twist.wz]]), np.array([pose.x, pose.y, pose.yaw])
        _, hits, _ = self._score(twists, pose, footprint, around, here)
        return not np.isfinite(hits[0])

    def room(self, pose: PlanarPose, footprint: Footprint, around: Around) -> float:
        """Return the distance of the footprint from the nearest obstacle [m]."""
        clearance, frame = around.clearance, around.frame
        u = footprint.at(pose) - frame[:2]
        column = np.floor((frame[2] * u[:, 0] + frame[3] * u[:, 1]) / frame[4]).astype(int)
        row = np.floor((frame[2] * u[:, 1] - frame[3] * u[:, 0]) / frame[4]).astype(int)
        rows, columns = clearance.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return float(clearance[row[inside], column[inside]].min(initial=10.0))

    def _score(
        self, twists: Array, pose: PlanarPose, footprint: Footprint, around: Around, aim: Array
    ) -> tuple[Array, Array, Array]:
        scores, hits, spare = (np.empty(len(twists)) for _ in range(3))
        here, weights = np.array([pose.x, pose.y, pose.yaw]), np.array([*WEIGHTS, self.config.margin])
        horizon = np.array([self.config.horizon, STEP, self.config.yields])
        score(twists, here, footprint.samples, around, aim, weights, horizon, scores, hits, spare)
        return scores, hits, spare
