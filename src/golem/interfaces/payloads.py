"""What the streams between modules carry, beside the words of `golem.types`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from golem.types import Array, CameraInfo, LocalizedObject, PlanarPose, RgbdImage, Twist


@dataclass(frozen=True, slots=True)
class LegCommand:
    """Command of the legs for one tick: tau_motor = kp (q - q_meas) - kd dq_meas + tau.

    Attributes:
        q: (12,) joint targets in motor order, left leg then right leg [rad].
        kp: (12,) stiffness the controller wants at the motors [N m/rad].
        kd: (12,) damping the controller wants at the motors [N m s/rad].
        tau: (12,) feed-forward torque [N m]. None leaves it to the servo, which then carries the weight of legs that
            hang free: right in a hoist, wrong on the ground.
    """

    q: Array
    kp: Array
    kd: Array
    tau: Array | None = None


@dataclass(frozen=True, slots=True)
class ArmCommand:
    """Command of the upper body for one tick.

    Attributes:
        q: (15,) joint targets, torso, left arm, right arm [rad]; inside the position limits, and no
            further from the previous tick's targets than the velocity limits of `robots.model.table` allow. The first
            ones after a reset start from the measured joints.
        error_position: (2,) distance of the left and right grasp frame from its target at `q` [m]; 0 without one.
        error_rotation: (2,) angle between grasp frame and target at `q` [rad]; 0 for an arm without one.
        limited: True where a limit (position, velocity, or the guard of a far target) held the motion back at
            this tick, so that the error cannot be expected to shrink at the nominal rate.
    """

    q: Array
    error_position: Array
    error_rotation: Array
    limited: bool


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """Where torso and arms are to be, and when.

    Attributes:
        t: time at which it begins [s].
        times: (n,) times of its points after that [s], increasing. None at all: what is followed now is given up.
        q: (n, 15) torso, left arm, right arm [rad].
        dq: (n, 15) their velocities there [rad/s]; None goes straight from point to point.
    """

    t: float
    times: Array
    q: Array
    dq: Array | None = None


class GripState(StrEnum):
    """What a hand is doing, or has found."""

    OPENING = "opening"
    """The fingers move to a commanded gap."""
    OPEN = "open"
    """They are there."""
    CLOSING = "closing"
    """They close; nothing is touched by both."""
    CONTACT = "contact"
    """Both fingers touch something; the grip has not settled yet."""
    HOLDING = "holding"
    """Both fingers press on something and the gap is at rest."""
    EMPTY = "empty"
    """They closed on nothing."""
    SLIPPED = "slipped"
    """Something was held and no longer is."""


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
class HandStatus:
    """What a hand's controller reports.

    Attributes:
        t: time stamp of the report it is based on [s].
        state: see `GripState`.
        gap: opening [m].
        offset: where between the fingers the middle of the opening is, along the closing axis [m]: 0 when both are
            equally far from the hand's centre plane, positive when finger a (+y) is further out.
        force: (2,) force of each finger [N].
    """

    t: float
    state: GripState
    gap: float
    offset: float
    force: Array

    @property
    def holding(self) -> bool:
        """Whether something is held: both fingers press, wider apart than closed, at rest."""
        return self.state is GripState.HOLDING


@dataclass(frozen=True, slots=True)
class LegStatus:
    """What the base layer of the lower body did at one tick.

    Attributes:
        t: time [s].
        commanded: the newest twist as it came, however impossible; zero for one that is not finite, see `reason`.
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
        speed: greatest speed over the ground that the controller in charge follows [m/s]; 0: it does not walk.
        trace: of that failure, see `ModuleFault`.
        height: that the controller is given now [m], see `LocomotionCommand`; heights: `Envelope.height`.
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
    speed: float = math.inf
    trace: str | None = None
    height: float | None = None
    heights: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Odometry:
    """Where base_link is in odom by a source of its own.

    Attributes:
        t: time of the measurement [s].
        T_odom_base: (4, 4) pose of base_link in odom.
        T_base_lidar: (4, 4) pose of lidar_link in base_link as the source takes it to be; None of one without LiDAR.
        covariance: (6, 6) of the error of `T_odom_base`, see `OdometryEstimate`; None of a source that has none.
    """

    t: float
    T_odom_base: Array
    T_base_lidar: Array | None = None
    covariance: Array | None = None


@dataclass(frozen=True, slots=True)
class OdometrySilence:
    """That whatever locates the robot does not know where it is.

    Attributes:
        t: since when [s].
        why: one sentence; empty once it knows again.
    """

    t: float
    why: str


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

    `labels`: what to look for; empty stops the stream, so that nothing is rendered or inferred unasked.
    """

    labels: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Detections:
    """What a localizer found in one frame.

    Attributes:
        t: time of the frame [s].
        camera: which camera.
        objects: everything found, in no order.
        labels: what was looked for: that something else is not among the objects says nothing.
        frame: the frame itself; None where only what was found in it came here.
    """

    t: float
    camera: str
    objects: tuple[LocalizedObject, ...]
    labels: tuple[str, ...] = ()
    frame: RgbdImage | None = None


@dataclass(frozen=True, slots=True)
class EstopMessage:
    """One frame of an emergency-stop board.

    Attributes:
        t: time of reception [s].
        sequence: counts up by one per frame and may wrap; a frame with the sequence of its predecessor says nothing.
        pressed: whether the button is pressed, or its wire cut.
    """

    t: float
    sequence: int
    pressed: bool


class GateState(StrEnum):
    """Where the gate is. Only `ACTIVE` lets a command through."""

    INIT = "init"
    """Something that must be there is missing; the command is limp, and a live gate sends none."""
    ARMED = "armed"
    """State and emergency stop are sound; the motors damp; waits for the request to activate."""
    ACTIVE = "active"
    """Commands pass, limited."""
    STOP1 = "stop1"
    """Stopped and latched: the motors damp (kp = 0, kd > 0)."""
    STOP0 = "stop0"
    """Stopped and latched: the motors are limp (kp = kd = 0)."""
    STOP2 = "stop2"
    """Stopped and latched: the gate's own controller stands on the legs, the arms damp."""

    @property
    def stopped(self) -> bool:
        """Whether the robot was stopped, and stays so until the gate is reset."""
        return self in (GateState.STOP2, GateState.STOP1, GateState.STOP0)


class Reason(StrEnum):
    """Why the gate is not armed, or why it stopped."""

    CLOCK = "clock_backwards"
    STALLED = "gate_stalled"
    REQUESTED = "stop_requested"
    ESTOP_MISSING = "estop_never_seen"
    ESTOP_STALE = "estop_stale"
    ESTOP_TIME = "estop_time_invalid"
    ESTOP_PRESSED = "estop_pressed"
    STATE_MISSING = "state_never_seen"
    STATE_STALE = "state_stale"
    STATE_TIME = "state_time_invalid"
    STATE_INVALID = "state_not_finite"
    STATE_CLOCK = "state_clock"
    STATE_JUMPED = "state_clock_jumped"
    STATE_FROZEN = "state_frozen"
    STATE_IMPLAUSIBLE = "state_implausible"
    IMU_IMPLAUSIBLE = "imu_implausible"
    POSITION = "joint_position"
    VELOCITY = "joint_velocity"
    TORQUE = "joint_torque"
    BRAKING = "joint_braking_distance"
    TILT = "tilt"
    BASE_STALE = "base_estimate_stale"
    BALANCE = "balance_lost"
    STANDING = "standing_failed"
    WRITERS = "two_writers"
    HELD = "motors_held"
    UNHEARD = "motors_unheard"
    NOT_IN_CONTROL = "not_in_control"
    STATE_DAMAGED = "state_damaged"
    MOTOR = "motor_error"
    MOTOR_DEAD = "motor_does_not_follow"
    MOTOR_MODE = "motor_mode"
    MOTOR_HOT = "motor_temperature"
    MOTOR_VOLTAGE = "motor_voltage"
    COMMAND_DAMAGED = "command_damaged"
    COMMAND_MISSING = "command_never_seen"
    COMMAND_STALE = "command_stale"
    COMMAND_TIME = "command_time_invalid"
    COMMAND_INVALID = "command_not_finite"
    COMMAND_UNSTAMPED = "command_unstamped"
    COMMAND_GAINS = "command_gains"
    COMMAND_JOLTS = "command_torque_jumps"
    COMMAND_BEYOND = "command_beyond_robot"
    COMMAND_HUNG = "command_hung"
    COMMAND_AWAY = "command_away"


class Fault(NamedTuple):
    """A reason, and one line that names the joint, the sender or the figures.

    Attributes:
        reason: why.
        detail: one line; may be empty.
        stands: whether state and legs are sound in spite of it, because it is about the upper body alone.
    """

    reason: Reason
    detail: str = ""
    stands: bool = False


@dataclass(frozen=True, slots=True)
class GateStatus:
    """What the gate lets everybody know.

    Attributes:
        t: when it ran [s].
        state, reason, detail: see `GateResult`.
    """

    t: float
    state: GateState
    reason: Reason | None = None
    detail: str = ""

    @property
    def stopped(self) -> bool:
        """See `GateState.stopped`."""
        return self.state.stopped

    @property
    def why(self) -> str:
        """The reason and its detail in one line, without a full stop; empty where there is none."""
        return ": ".join(filter(None, (self.reason, self.detail)))


@dataclass(frozen=True, slots=True)
class Feedback:
    """What a running skill says of itself.

    Attributes:
        t: time [s].
        skill: name of the skill.
        stage: the stage it is in, e.g. `"detect"`.
        text: one line for a person.
        data: numbers and points that a viewer may show, e.g. `{"target": [x, y, z]}` in odom.
    """

    t: float
    skill: str
    stage: str
    text: str
    data: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, slots=True)
class ModuleFaultMsg:
    """A module broke its contract, or cannot do what the skill that runs asks of it; the skill ends with it.

    Attributes:
        slot: its slot; None where it is the skill's goal that makes no sense to it.
        reason: what it did, and its name.
        stage: of the skill's result.
        trace: see `ModuleFault`.
    """

    slot: str | None
    reason: str
    stage: str = "fault"
    trace: str | None = None
