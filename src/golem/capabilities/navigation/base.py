"""The contract of a navigator: a goal pose and the present one in, twists for the lower body out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from golem.types import PlanarPose, Twist


@dataclass(frozen=True, slots=True)
class NavStep:
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

    def step(self, pose: PlanarPose, moving: bool, dt: float) -> NavStep:
        """Advance by one tick.

        Args:
            pose: where base_link is in odom, as well as the robot knows.
            moving: whether the lower body moves the base, commanded or for its balance: only while it does not, the
                robot stays where it is.
            dt: time since the previous tick [s], positive.
        """
        ...
