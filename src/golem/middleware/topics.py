"""Names of the streams on the bus and the small messages that only coordinate modules."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, CameraInfo, LocalizedObject, PlanarPose, Side, Twist

LOW_STATE = "lowstate"
"""`LowState` at 500 Hz, from the robot."""
LOW_CMD_REQUEST = "safety/lowcmd_in"
"""`LowCommand` at 500 Hz, from the servo to the safety gate."""
LOW_CMD = "lowcmd"
"""`LowCommand` at 500 Hz, from the safety gate to the robot; nobody else writes it."""
BASE = "base_estimate"
"""`BaseEstimate` at 500 Hz."""
ESTOP = "estop"
"""`EstopMessage` at 100 Hz."""
SAFETY = "safety/status"
"""`GateStatus` whenever the safety gate ran."""
TRANSPORT_FAULT = "safety/transport"
"""`Fault` that the gate shall stop for: something is wrong with the way its frames come."""
PALM_TARGETS = "palm_targets"
"""`PalmTargets` in odom, from the running skill."""
ARM_COMMAND = "arm_command"
"""`ArmCommand`, from the upper-body controller."""
LEG_COMMAND = "leg_command"
"""`LegCommand`, from the lower-body controller."""
TWIST = "cmd_vel"
"""`Twist` for the lower body."""
MODULE_FAULT = "module_fault"
"""`ModuleFaultMsg`, of a module without which the robot can still stand."""
LEG_STATUS = "legs/status"
"""`LegStatus`, from the base layer of the lower body."""
ODOMETRY = "odometry"
"""`Odometry` from whatever locates the robot better than its base estimate; a stack without it never sends any."""
FEEDBACK = "skill/feedback"
"""`Feedback` of the running skill."""


def hand_state(side: Side) -> str:
    """Return the topic of `HandState` of one hand."""
    return f"{side}/gripper/state"


def hand_command(side: Side) -> str:
    """Return the topic of `HandCommand` of one hand."""
    return f"{side}/gripper/command"


def hand_goal(side: Side) -> str:
    """Return the topic on which a skill tells one hand what to do (`HandGoal`)."""
    return f"{side}/gripper/goal"


def hand_status(side: Side) -> str:
    """Return the topic of the hand controller's `HandStatus`."""
    return f"{side}/gripper/status"


def exposures(camera: str) -> str:
    """Return the topic of `Exposure` of one camera."""
    return f"exposures/{camera}"


def rgbd_images(camera: str) -> str:
    """Return the topic of `RgbdImage` of one camera."""
    return f"realsense/{camera}"


def detection_request(camera: str) -> str:
    """Return the topic of `DetectionRequest` for one camera."""
    return f"look/{camera}"


def detections(camera: str) -> str:
    """Return the topic of `Detections` from one camera."""
    return f"objects/{camera}"


@dataclass(frozen=True, slots=True)
class Exposure:
    """What a camera saw, before anybody says from where: a `RgbdImage` without its pose.

    Attributes:
        t, info, rgb, depth: as in `RgbdImage`.
    """

    t: float
    info: CameraInfo
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class DetectionRequest:
    """Ask a camera and the localizer behind it to stream.

    Attributes:
        labels: what to look for; empty stops the stream, so that nothing is rendered or inferred unasked.
    """

    labels: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Detections:
    """What a localizer found in one frame.

    Attributes:
        t: time of the frame [s].
        camera: which camera.
        objects: everything found, in no order.
    """

    t: float
    camera: str
    objects: tuple[LocalizedObject, ...]


@dataclass(frozen=True, slots=True)
class HandGoal:
    """What a skill wants of one hand: open to `gap`, or close with `force`.

    Attributes:
        gap: opening to move to [m]; None closes.
        force: force of each finger to close with [N]; used when `gap` is None.
    """

    gap: float | None
    force: float = 0.0


@dataclass(frozen=True, slots=True)
class LegStatus:
    """What the base layer of the lower body did at one tick.

    Attributes:
        t: time [s].
        commanded: the newest twist, as it came: it may be far outside what is possible, or not finite.
        applied: the twist the robot shall move at; the controller is given a corrected one.
        clamped: whether `commanded` lies outside the controller's envelope.
        reason: why `applied` is not on its way to `commanded`; empty where it is.
        stepping: whether the gait clock runs.
        moving: whether the robot changes its place: a twist is applied, or it steps though its controller's clock could
            rest. A controller without a clock moves without stepping, one that marks time steps without moving.
        rest: where base_link would come to rest if the robot were told to stand now, as seen from base_link.
        phase: (2,) gait phase of the left and the right leg, 0 to 1.
        controller: the implementation in charge, as the stack names it.
        fault: how the stack's own controller failed, once the fallback is in charge; else None.
    """

    t: float
    commanded: Twist
    applied: Twist
    clamped: bool
    reason: str
    stepping: bool
    moving: bool
    rest: PlanarPose
    phase: Array
    controller: str
    fault: str | None = None


@dataclass(frozen=True, slots=True)
class ModuleFaultMsg:
    """A module broke its contract; the skill that runs ends with it.

    Attributes:
        slot: its slot.
        reason: what it did, and its name.
    """

    slot: str
    reason: str


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where base_link is in odom by a source of its own.

    Attributes:
        t: time of the measurement [s].
        T_odom_base: (4, 4) pose of base_link in odom.
    """

    t: float
    T_odom_base: Array
