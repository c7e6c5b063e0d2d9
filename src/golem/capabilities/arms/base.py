"""The contract of an upper-body controller: two palm poses in, 15 joint targets out."""

from __future__ import annotations

import math
from typing import Protocol, runtime_checkable

import numpy as np

from golem.capabilities.arms.ik_kernel import rigid
from golem.errors import GolemError
from golem.interfaces.payloads import ArmCommand
from golem.types import NUM_JOINTS, UPPER, Array, Side

NUM_UPPER = UPPER.stop - UPPER.start
"""Joints of the upper body: torso, left arm (7), right arm (7)."""
ARM_COLUMNS: dict[Side, slice] = {"left": slice(1, 8), "right": slice(8, 15)}
"""Where each arm's joints lie in a (15,) upper-body vector; index 0 is the torso."""
GRIPPER_FRAME: dict[Side, str] = {"left": "left_gripper", "right": "right_gripper"}
"""Names of the grasp frames: z is the approach direction, y the closing axis."""


class TargetError(GolemError):
    """A palm target or a measured posture is not something an arm can be sent to."""


@runtime_checkable
class UpperBody(Protocol):
    """Turns two palm poses into joint targets of torso and arms.

    A controller integrates its own command state: the next output follows from the previous output, not
    from the measured joints, so that servo lag and gravity sag do not feed back into the targets. It is
    passive (no clock, no bus), deterministic, and answers every tick with finite targets inside the limits.

    Joint trajectories are no controller's business: `trajectory.TrajectoryFollower` follows them for all of them, and
    the controller is reset to where one ended.

    Attributes:
        rate: ticks per second it wants to be run at [Hz].
        latency: time from reading the targets to the command being available, as the lock-step runner shall
            account for it [s].
    """

    rate: float
    latency: float

    def reset(self, q: Array) -> None:
        """Set the command state and the posture to return to.

        Args:
            q: (27,) joint positions in motor order [rad]; the upper body is clipped into the position limits. A waist
                that is outside the range it works in stays there until a hand has a target, and comes back slowly.

        Raises:
            TargetError: `q` has another shape or is not finite.
        """

    def step(self, targets_left: Array | None, targets_right: Array | None, q_measured: Array, dt: float) -> ArmCommand:
        """Advance the command state by one tick.

        Args:
            targets_left: (4, 4) pose of `left_gripper` in base_link, or None: the arm keeps its posture.
            targets_right: (4, 4) pose of `right_gripper` in base_link, or None: the arm keeps its posture.
            q_measured: (27,) measured joint positions [rad], for controllers that check against the robot.
            dt: time since the previous tick [s], positive.

        Returns:
            The joint targets and what is left of the errors.

        Raises:
            TargetError: a target is not a finite rigid transform, `q_measured` is not finite or of another
                shape, or `dt` is not positive.
        """
        ...


@runtime_checkable
class HasWaist(Protocol):
    """An upper-body controller whose waist can be turned at will."""

    def turn_waist(self, angle: float | None) -> None:
        """Prefer `angle` [rad] for the waist where the hands leave it free; None is the controller's own."""


def check_pose(name: str, pose: Array) -> Array:
    """Return `pose` as a (4, 4) float64 array if it is a rigid transform.

    Args:
        name: what the pose is, for the message.
        pose: (4, 4) homogeneous matrix; the rotation may be off by 1e-4, as after many products.

    Raises:
        TargetError: wrong shape, not finite, or not a rotation and a translation.
    """
    T = np.asarray(pose, dtype=np.float64)
    if T.shape == (4, 4) and T.flags.carray and rigid(T):
        return T
    if T.shape != (4, 4):
        raise TargetError(f"{name} must be a 4x4 homogeneous matrix, not an array of shape {T.shape}.")
    if not np.isfinite(T).all():
        raise TargetError(f"{name} contains NaN or infinity; give a finite pose, or None to keep the arm still.")
    R = T[:3, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-4 or np.linalg.det(R) < 0 or np.abs(T[3] - (0, 0, 0, 1)).max() > 1e-9:
        raise TargetError(f"{name} is not a rigid transform; its upper left 3x3 block must be a rotation matrix.")
    return T


def check_joints(name: str, q: Array) -> Array:
    """Return `q` as a (27,) float64 array. Raises TargetError: wrong shape or not finite."""
    values = np.asarray(q, dtype=np.float64)
    if values.shape != (NUM_JOINTS,):
        raise TargetError(f"{name} must have shape ({NUM_JOINTS},), one value per motor, not {values.shape}.")
    # A product with itself costs a third of isfinite and all; see `golem.finite`.
    if not math.isfinite(values.dot(values)) and not np.isfinite(values).all():
        raise TargetError(f"{name} contains NaN or infinity; give the joint positions in radians.")
    return values


def check_dt(dt: float) -> None:
    """Refuse a time step that is not a positive, finite number of seconds. Raises TargetError: it is not."""
    if not 0.0 < dt < float("inf"):
        raise TargetError(f"dt must be a positive number of seconds, not {dt}.")
