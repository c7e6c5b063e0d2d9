"""What the streams around the navigator carry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, PlanarPose, Twist


@dataclass(frozen=True, slots=True)
class OccupancyGrid:
    """A map of the floor, as nav_msgs/OccupancyGrid has it.

    Attributes:
        t: time of the newest measurement in it [s].
        origin: pose in odom of the corner of cell [0, 0]; columns go along its x, rows along its y.
        resolution: side of a cell [m].
        cells: (rows, columns) int8: 0 free to 100 occupied, -1 unknown.
    """

    t: float
    origin: PlanarPose
    resolution: float
    cells: NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Scan:
    """What a LiDAR hit in one revolution.

    Attributes:
        t: time of the measurement [s].
        points: (n, 3) in odom [m].
    """

    t: float
    points: Array


@dataclass(frozen=True, slots=True)
class NavGoal:
    """Where a skill wants the robot to be.

    Attributes:
        pose: of base_link in odom; None: nowhere any more.
    """

    pose: PlanarPose | None


@dataclass(frozen=True, slots=True)
class NavStep:
    """What a navigator says at one step.

    Attributes:
        twist: what the lower body is to do; zero is stand.
        arrived: whether the robot stands at the goal, as well as it can.
        left: where the goal is as seen from the robot, by the navigator's own smoothed estimate.
        failure: one sentence why the goal cannot be reached; None while it may.
    """

    twist: Twist
    arrived: bool
    left: PlanarPose
    failure: str | None = None

    @classmethod
    def failed(cls, reason: str, left: PlanarPose) -> NavStep:
        """Return the step that gives the goal up for `reason`, one sentence, with so much `left`."""
        return cls(Twist(), False, left, reason)

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to do."""
        return self.arrived or self.failure is not None
