"""The contract of a navigator: a goal pose and the present one in, twists for the lower body out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from golem.types import Array, Twist


@dataclass(frozen=True, slots=True)
class PlanarPose:
    """A pose on the floor.

    Attributes:
        x, y: position [m].
        yaw: heading [rad].
    """

    x: float
    y: float
    yaw: float

    @classmethod
    def of(cls, T: Array) -> PlanarPose:
        """Return where the (4, 4) pose `T` stands and heads."""
        return cls(float(T[0, 3]), float(T[1, 3]), math.atan2(T[1, 0], T[0, 0]))

    def __matmul__(self, other: PlanarPose) -> PlanarPose:
        """Return the pose `other`, given in the frame of this one, in the frame in which this one is given."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return PlanarPose(
            self.x + c * other.x - s * other.y, self.y + s * other.x + c * other.y, wrap(self.yaw + other.yaw)
        )

    def to(self, other: PlanarPose) -> PlanarPose:
        """Return the pose `other` in the frame of this one, both given in one frame."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        x, y = other.x - self.x, other.y - self.y
        return PlanarPose(c * x + s * y, c * y - s * x, wrap(other.yaw - self.yaw))


@dataclass(frozen=True, slots=True)
class Course:
    """What a navigator says at one tick.

    Attributes:
        twist: what the lower body is to do; zero is stand.
        arrived: whether the robot stands at the goal, as well as it can.
        left: where the goal is as seen from the robot, by the navigator's own smoothed estimate.
    """

    twist: Twist
    arrived: bool
    left: PlanarPose


@runtime_checkable
class Navigator(Protocol):
    """Brings the base to a goal pose."""

    def start(self, goal: PlanarPose) -> None:
        """Pursue `goal`, in odom, from the next tick on; of earlier ones counts what they taught about legs."""
        ...

    def step(self, pose: PlanarPose, moving: bool, dt: float) -> Course:
        """Advance by one tick.

        Args:
            pose: where base_link is in odom, as well as the robot knows.
            moving: whether the lower body moves the base, commanded or for its balance: only while it does not, the
                robot stays where it is.
            dt: time since the previous tick [s], positive.
        """
        ...


def wrap(angle: float) -> float:
    """Return `angle` [rad] between -pi and pi."""
    return math.remainder(angle, math.tau)
