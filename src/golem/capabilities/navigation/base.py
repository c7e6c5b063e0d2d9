"""The contract of a navigator: a goal pose and what is known of the way in, twists for the lower body out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from golem.capabilities.navigation.footprint import Footprint
from golem.interfaces.nav_payloads import NavStep, OccupancyGrid, Scan
from golem.types import PlanarPose


@dataclass(frozen=True, slots=True)
class NavInputs:
    """What a navigator is shown.

    Attributes:
        pose: where base_link would come to rest in the frame of the goal (odom, or map) if the robot stopped now, as
            well as the robot knows.
        moving: whether the lower body moves the base, commanded or for its balance: only while it does not, the robot
            stays where it is.
        grid: the newest map, its origin in that frame; None in a stack that makes none.
        scan: the newest scan, in that frame; None in a stack that has no LiDAR.
        footprint: the room that the robot takes up on the floor, its arms where they are; None where nobody says.
    """

    pose: PlanarPose
    moving: bool
    grid: OccupancyGrid | None = None
    scan: Scan | None = None
    footprint: Footprint | None = None


@runtime_checkable
class Navigator(Protocol):
    """Brings the base to a goal pose.

    Attributes:
        rate: steps per second that it wants [Hz], from 1 to 100. Its newest twist holds in between.
        latency: time from the inputs to the step being available [s]. Live, a step that declares one is computed on a
            thread of its own and takes what it takes.
    """

    rate: float
    latency: float

    def start(self, goal: PlanarPose) -> None:
        """Pursue `goal`, in odom or map, from the next step on; of earlier ones counts what they taught about legs."""

    def step(self, inputs: NavInputs, dt: float) -> NavStep:
        """Advance by one step.

        Args:
            inputs: where the robot is, and what is around it.
            dt: time since the previous step, or since the start [s], positive.

        Returns:
            What the legs are to do; once the robot has arrived, or with `NavStep.failed` where there is no way.
        """
        ...
