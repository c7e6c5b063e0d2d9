"""What the streams around the navigator carry."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, PlanarPose, Twist

HERE = PlanarPose(0.0, 0.0, 0.0)
"""The origin of a frame."""


@dataclass(frozen=True, slots=True)
class OccupancyGrid:
    """A map of the floor, as nav_msgs/OccupancyGrid has it.

    Attributes:
        t: time of the newest measurement in it [s].
        origin: pose in odom of the corner of cell [0, 0]; columns go along its x, rows along its y.
        resolution: side of a cell [m].
        cells: (rows, columns) int8: 0 free to 100 occupied, -1 unknown.
        T_odom_map: where the map's own frame is in odom.
    """

    t: float
    origin: PlanarPose
    resolution: float
    cells: NDArray[np.int8]
    T_odom_map: PlanarPose = HERE

    @property
    def in_map(self) -> OccupancyGrid:
        """It in its own frame."""
        return replace(self, origin=self.T_odom_map.to(self.origin), T_odom_map=HERE)


@dataclass(frozen=True, slots=True)
class MapPlace:
    """Where the map is.

    Attributes:
        t: time [s].
        T_odom_map: the map's frame in odom of the odometry, by which skills and navigator go.
        T_map_estimate: odom of the base estimate in the map's frame: what /tf says from `map` to `odom`.
    """

    t: float
    T_odom_map: PlanarPose
    T_map_estimate: PlanarPose


@dataclass(frozen=True, slots=True)
class Scan:
    """What a LiDAR hit in one scan, the robot itself left out.

    Attributes:
        t: time of the scan's end [s].
        points: (n, 3) in odom, finite [m].
        origin: (3,) where the sensor was in odom at the scan's end [m].
        floor: (3,) plane of the floor, z = floor[0] x + floor[1] y + floor[2] in odom [m].
    """

    t: float
    points: Array
    origin: Array
    floor: Array

    @property
    def heights(self) -> Array:
        """(n,) height of each point above the floor [m]."""
        return self.points[:, 2] - self.points[:, :2] @ self.floor[:2] - self.floor[2]

    def seen_from(self, T: PlanarPose) -> Scan:
        """Return it in the frame in which odom is at `T`."""
        c, s = math.cos(T.yaw), math.sin(T.yaw)
        turned = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        shift = np.array([T.x, T.y, 0.0])
        slope = self.floor[:2] @ turned[:2, :2]
        floor = np.array([*slope, self.floor[2] - slope @ shift[:2]])
        return Scan(self.t, self.points @ turned + shift, self.origin @ turned + shift, floor)


@dataclass(frozen=True, slots=True)
class MapFile:
    """Where a map is to be kept, or was.

    Attributes:
        path: of the map, without ending.
        problem: one sentence why it could not be written; empty where it was, or is to be.
    """

    path: str
    problem: str = ""


@dataclass(frozen=True, slots=True)
class NavGoal:
    """Where a skill wants the robot to be.

    Attributes:
        pose: of base_link; None: nowhere any more.
        frame: what the pose is given in; in `map` it stays where it is in the hall when odom drifts.
    """

    pose: PlanarPose | None
    frame: Literal["odom", "map"] = "odom"


@dataclass(frozen=True, slots=True)
class NavPath:
    """The way that a navigator means to go.

    Attributes:
        t: time [s].
        points: (n, 2) places [m]; n is 0 where it has none any more.
        frame: what they are given in.
    """

    t: float
    points: Array
    frame: Literal["odom", "map"]


@dataclass(frozen=True, slots=True)
class NavStep:
    """What a navigator says at one step.

    Attributes:
        twist: what the lower body is to do; zero is stand.
        arrived: whether the robot stands at the goal, as well as it can.
        left: where the goal is as seen from the robot, by the navigator's own smoothed estimate.
        failure: one sentence why the goal cannot be reached; None while it may.
        path: (n, 2) places of the way that it means to go, in the frame of the goal [m]; None where it has none.
        note: what it does, in a word or two, for people: `follow`, `wait`.
        people: (k, 5) those it takes to walk about: place [m] and velocity [m/s] in the frame of the goal, and the
            radius that it keeps from [m].
    """

    twist: Twist
    arrived: bool
    left: PlanarPose
    failure: str | None = None
    path: Array | None = None
    note: str = ""
    people: Array = field(default_factory=lambda: np.zeros((0, 5)))

    @classmethod
    def failed(cls, reason: str, left: PlanarPose) -> NavStep:
        """Return the step that gives the goal up for `reason`, one sentence, with so much `left`."""
        return cls(Twist(), False, left, reason)

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to do."""
        return self.arrived or self.failure is not None


Nav2State = Literal["absent", "rejected", "active", "succeeded", "aborted", "canceled"]
"""How a goal that was given to Nav2 stands; absent: nobody offers the action."""


@dataclass(frozen=True, slots=True)
class Nav2Goal:
    """A goal for Nav2.

    Attributes:
        number: tells goals apart.
        pose: where to, in the frame of the goal that the navigator pursues.
    """

    number: int
    pose: PlanarPose


@dataclass(frozen=True, slots=True)
class Nav2Reply:
    """How a goal stands.

    Attributes:
        number: of the goal.
        state: how it stands.
    """

    number: int
    state: Nav2State


@dataclass(frozen=True, slots=True)
class Nav2Twist:
    """What Nav2's controller commands.

    Attributes:
        t: when it came [s].
        twist: in base_link.
    """

    t: float
    twist: Twist
