"""The contract of a robot: motor commands in, measurements out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from golem.interfaces.lidar import LidarImu, LidarScan
from golem.native import CompiledStage
from golem.types import Array, CameraInfo, HandCommand, HandState, Imu, LowCommand, Side

STAMP_TOLERANCE = 5e-4
"""Tolerance of a stamp [s]: half of the resolution in which the robot tells its time."""


class Robot(Protocol):
    """One H1-2 with MAGPIE hands and its cameras, real or simulated.

    A robot reports measurements only. Where things really are is not part of the contract.

    Attributes:
        cameras: the cameras it carries, by name.
        calibration: per camera the (4, 4) pose of its optical frame, as the calibration claims it, in the optical
            frame of the nominal model; identity where the camera was never calibrated.
    """

    cameras: dict[str, CameraInfo]
    calibration: dict[str, Array]

    def advance(self, command: LowCommand, hands: dict[Side, HandCommand], dt: float) -> None:
        """Let time pass under the given commands.

        Args:
            command: latched by the motors, which run tau = kp (q - q_meas) + kd (dq - dq_meas) + tau themselves.
            hands: command of each hand.
            dt: time to advance [s].
        """

    def joints(self) -> tuple[Array, Array, Array]:
        """Return q [rad], dq [rad/s] and tau [N m], each (27,), as the motors report them."""
        ...

    def imu(self) -> Imu:
        """Return the present sample of the torso IMU."""
        ...

    def hand(self, side: Side, t: float) -> HandState:
        """Return what one hand reports, stamped `t` [s]."""
        ...

    def capture(self, camera: str) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Expose one camera now.

        Returns:
            rgb: (height, width, 3) uint8.
            depth: (height, width) float32 along the optical axis [m], 0 where invalid.
        """
        ...

    def close(self) -> None:
        """Release what the robot holds: rendering contexts, connections. Closing twice does nothing."""


@runtime_checkable
class Standing(Protocol):
    """A class of robots that may stand on their feet; a robot whose class does not say so hangs in the hoist."""

    @classmethod
    def on_feet(cls, options: Mapping[str, object]) -> bool:
        """Return whether a robot with these options of the stack file stands, once its band is let go."""
        ...


@runtime_checkable
class HasGantry(Protocol):
    """A robot that is brought up standing, with a band that keeps it upright until its legs do.

    `on_gantry`: whether there is a band that is still to be let go; false for a robot that hangs and shall hang.
    """

    on_gantry: bool

    def release(self) -> None:
        """Let the band go, smoothly; an operator's act. Without a band it does nothing."""


@runtime_checkable
class HasLivingSensors(Protocol):
    """A robot that says whether its sensors live; of one that does not the gate believes sensors that stand still.

    `living`: whether the last digits of every limb and of the IMU always move, as those of real sensors do.
    """

    living: bool


@runtime_checkable
class Unmoved(Protocol):
    """A robot that no command moves as it moves a body: measured answers to commands say nothing about it.

    `unmoved`: why, in a few words, e.g. "it is a recording".
    """

    unmoved: str


@runtime_checkable
class HasLidar(Protocol):
    """A robot with a LiDAR on its torso."""

    def lidar(self, t: float) -> tuple[list[LidarImu], LidarScan | None]:
        """Return the IMU's samples since the last call and the scan that has arrived, if one has. `t`: time [s].

        Called once per tick, or every `lidar_period` [s] where the robot has an attribute of that name.
        """
        ...


@runtime_checkable
class Restorable(Robot, Protocol):
    """A simulated robot whose moment can be shown by another that was built alike, in another process."""

    def save_state(self) -> bytes:
        """Return the present moment."""
        ...

    def restore_state(self, save_state: bytes) -> None:
        """Be in the moment of a snapshot: `capture` then shows what it showed there."""


@runtime_checkable
class HasStages(Protocol):
    """A simulated robot that offers compiled stages for the 500 Hz chain; see `golem.native`."""

    def native(self, joint_offset: Array | None) -> tuple[CompiledStage, CompiledStage] | None:
        """Return the stages that sense and act, on the state of the methods of `Robot`; None where there are none.

        `joint_offset`: (27,) what calibration knows of the encoders' zeros: reported minus true [rad].
        """
        ...

    def keep_moment(self, t: float) -> None:
        """Keep the moment `t` [s] for sensors that are read later, as the stage that senses does: Python has sensed."""

    def take_hand_command(self, side: Side, command: HandCommand) -> None:
        """Take the command of one hand for the ticks that stages let pass."""
