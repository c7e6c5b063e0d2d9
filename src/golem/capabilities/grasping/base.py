"""The contract of a grasp method: an object, the scene around it and a gripper in, ranked grasps or a servo law out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Protocol, runtime_checkable

import numpy as np

from golem.robots.model.magpie_model import MAX_FORCE, MAX_GAP, PAD_HALF_SIZE
from golem.types import Array, LocalizedObject, Side


@dataclass(frozen=True, slots=True)
class Gripper:
    """The hand that is to grasp, in numbers.

    Attributes:
        side: which hand.
        T_odom_gripper: (4, 4) where its grasp frame is, by the measured joints and the base estimate.
        yaw: heading in odom of its x axis about the vertical that suits the arm best [rad]; of a hand that points down.
        approach: (3,) unit vector in odom along which the task wants the hand to come; straight down by default.
        q: (15,) joints of torso, left arm, right arm [rad]; None where nobody says.
        T_odom_base: (4, 4) pose of base_link in odom.
        max_gap: widest opening between the pads [m].
        max_force: greatest force of one finger [N].
        pad_length: of a pad, along the approach axis [m].
        pad_width: of a pad, along x [m].
    """

    side: Side
    T_odom_gripper: Array
    yaw: float
    approach: Array = field(default_factory=lambda: np.array([0.0, 0.0, -1.0]))
    q: Array | None = None
    T_odom_base: Array = field(default_factory=lambda: np.eye(4))
    max_gap: float = MAX_GAP
    max_force: float = MAX_FORCE
    pad_length: float = 2.0 * float(PAD_HALF_SIZE[2])
    pad_width: float = 2.0 * float(PAD_HALF_SIZE[0])


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
    """Where a servo law stands.

    Attributes:
        TRACKING: on its way; the skill goes on to send the hand where the step says.
        CONVERGED: the fingers shall close now.
        LOST: the palm camera no longer sees the object; the attempt ends, and the localizer is named.
        STALLED: the hand comes no nearer; the attempt ends, and the upper body is named.
        TIGHT: the object stands no higher than one that is screwed down, and none beside it does; the attempt ends.
    """

    TRACKING = "tracking"
    CONVERGED = "converged"
    LOST = "lost"
    STALLED = "stalled"
    TIGHT = "tight"


@dataclass(frozen=True, slots=True)
class ServoStep:
    """What a servo law wants now.

    Attributes:
        T_odom_gripper: (4, 4) pose the gripper shall go to.
        target: (3,) filtered position of the object in odom [m].
        sigma: standard deviation of that position along its worst axis [m].
        status: whether it is still tracking. After `CONVERGED` the fingers close, and the hand stays where it is.
    """

    T_odom_gripper: Array
    target: Array
    sigma: float
    status: ServoStatus


class ServoLaw(Protocol):
    """A closed loop from sightings of the palm camera to gripper poses, in odom.

    The law decides how high the hand stays and when it goes down; the skill only sends the hand where each step says,
    at bounded speed.

    Attributes:
        label: what it follows.
        patience: time from its first step after which the skill gives it up if the fingers do not close [s].
    """

    label: str
    patience: float

    def step(self, t: float, sightings: list[LocalizedObject] | None, T_odom_gripper: Array) -> ServoStep:
        """Advance to time `t` [s].

        Args:
            t: present time [s].
            sightings: objects of one new frame, in no order; None when no new frame came.
            T_odom_gripper: (4, 4) where the gripper is by the measured joints.
        """
        ...


@runtime_checkable
class SeeingLaw(ServoLaw, Protocol):
    """A servo law that looks for itself instead of being told what a localizer found.

    Attributes:
        cameras: whose pictures it wants, `width` pixels wide; 0 is as they are.
    """

    cameras: tuple[str, ...]
    width: int

    def see(
        self, t: float, side: Side, T_odom_base: Array, observe: Callable[[], dict[str, Any] | None], live: bool
    ) -> None:
        """Look, before each step.

        Args:
            t: present time [s].
            side: of the hand at work.
            T_odom_base: (4, 4) pose of base_link in odom.
            observe: returns what there is to be seen, by the names of a data set; None while something is missing.
            live: whether time passes by itself, so that nobody may wait here.
        """


class GraspMethod(Protocol):
    """Proposes grasps for an object, and may close the loop on it.

    Attributes:
        latency: time that a proposal takes [s]: the hand waits for so long in lock-step. Live, `propose` runs on a
            thread of its own and takes what it takes. A servo law's step costs nothing: its images were paid for.
    """

    latency: float

    def propose(self, target: LocalizedObject, scene: Array, gripper: Gripper) -> list[Grasp]:
        """Return grasps for `target`, best first; empty when there is none.

        Args:
            target: the object as the head camera saw it, in odom.
            scene: (n, 3) everything that the head camera's newest frame shows, in odom, row by row [m]: the object,
                what lies around it, the robot's own arms. Pixels without a depth are left out: n varies, and may be 0.
            gripper: the hand that is to grasp.
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
