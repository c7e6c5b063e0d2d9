"""The contract of a grasp method: an object in, ranked grasps or a servo law out."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from golem.types import Array, LocalizedObject


@dataclass(frozen=True, slots=True)
class Grasp:
    """One way to take an object.

    Attributes:
        T_odom_gripper: (4, 4) pose of the grasp frame when the fingers close (z approach, y closing).
        gap: opening to arrive with [m].
        score: higher is better; comparable within one proposal only.
    """

    T_odom_gripper: Array
    gap: float
    score: float


class ServoStatus(StrEnum):
    """Where a servo law stands."""

    TRACKING = "tracking"
    CONVERGED = "converged"
    LOST = "lost"
    STALLED = "stalled"


@dataclass(frozen=True, slots=True)
class ServoStep:
    """What a servo law wants now.

    Attributes:
        T_odom_gripper: (4, 4) pose the gripper shall go to.
        target: (3,) filtered position of the object in odom [m].
        sigma: standard deviation of that position along its worst axis [m].
        status: whether it is still tracking. A law may go on after `CONVERGED`: it then follows the object while
            the fingers close.
    """

    T_odom_gripper: Array
    target: Array
    sigma: float
    status: ServoStatus


class ServoLaw(Protocol):
    """A closed loop from sightings of the palm camera to gripper poses, in odom.

    Attributes:
        label: what it follows.
    """

    label: str

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        """Advance to time `t` [s].

        Args:
            t: present time [s].
            sightings: objects of one new frame, in no order; None when no new frame came.
            T_odom_gripper: (4, 4) where the gripper is by the measured joints.
        """
        ...


class GraspMethod(Protocol):
    """Proposes grasps for an object, and may close the loop on it."""

    def propose(self, target: LocalizedObject, yaw: float) -> list[Grasp]:
        """Return grasps for `target`, best first; empty when there is none.

        Args:
            target: the object as the head camera saw it, in odom.
            yaw: heading of the gripper's x axis about the vertical that suits the arm best [rad].
        """
        ...

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        """Return the law that refines `grasp` from the palm camera from time `t` on [s]; None: open loop."""
        ...


class OpenLoop:
    """Mixin of the methods that trust the first look."""

    def servo(self, target: LocalizedObject, grasp: Grasp, t: float) -> ServoLaw | None:
        """Return None: the grasp is executed as proposed."""
        return None
