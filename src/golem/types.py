"""The words every layer uses: joint order, states, commands, images, objects.

Units are SI and radians. `T_a_b` is a 4x4 homogeneous matrix that maps the coordinates of a point in frame b
into frame a. Quaternions are wxyz. Frames follow REP-103 and REP-120. `base_link` is the pelvis link, x forward,
z up. `odom` is the world-fixed frame that coincides with the levelled base_link at the start of an episode.
Optical frames have z forward, x right, y down.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""A float64 array; every docstring that uses it gives the shape."""

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")

GRAVITY = 9.81
"""[m/s^2], as in the twin."""
TICK = 0.002
"""Period of the clock [s]: one servo period (500 Hz)."""
COMMAND_AGE = 0.1
"""Age of a command at which the drives go limp [s]; the authors' twin."""
NUM_JOINTS = 27
"""Body motors of the H1-2, in the order of the vendor's SDK."""
LEGS = slice(0, 12)
"""Motor indices of the two legs."""
ARMS = slice(13, 27)
"""Motors of both arms."""
UPPER = slice(12, 27)
"""Motor indices of the upper body: torso (1), left arm (7), right arm (7)."""


@dataclass(frozen=True, slots=True)
class Imu:
    """One sample of the torso IMU, in the frame `imu_link` (on the torso, above the waist joint).

    Attributes:
        quat: (4,) orientation of imu_link in a gravity-aligned world frame, wxyz.
        gyro: (3,) angular rate [rad/s].
        acc: (3,) specific force, +9.81 along up at rest [m/s^2].
    """

    quat: Array
    gyro: Array
    acc: Array


@dataclass(frozen=True, slots=True)
class LowState:
    """What the 27 body motors and the IMU report, at the servo rate.

    Attributes:
        t: time stamp [s].
        q: (27,) joint positions as the encoders report them [rad].
        dq: (27,) joint velocities [rad/s].
        tau: (27,) estimated joint torques [N m].
        imu: the torso IMU.
    """

    t: float
    q: Array
    dq: Array
    tau: Array
    imu: Imu


@dataclass(frozen=True, slots=True)
class LowCommand:
    """What the motors are told: tau_motor = kp (q - q_meas) + kd (dq - dq_meas) + tau.

    Attributes:
        t: time stamp [s].
        q, dq, tau, kp, kd: (27,) each [rad], [rad/s], [N m], [N m/rad], [N m s/rad].
    """

    t: float
    q: Array
    dq: Array
    tau: Array
    kp: Array
    kd: Array


@dataclass(frozen=True, slots=True)
class HandState:
    """What one MAGPIE hand reports.

    Attributes:
        t: time stamp [s].
        gap: opening between the two finger pads [m], 0 to 0.108.
        fingers: (2,) distance of each pad from the hand's centre plane [m]; they sum to `gap`.
        force: (2,) normal force of each pad as derived from the servo load [N].
    """

    t: float
    gap: float
    fingers: Array
    force: Array


@dataclass(frozen=True, slots=True)
class HandCommand:
    """What one MAGPIE hand is told.

    Attributes:
        t: time stamp [s].
        gap: opening to move to [m]; 0 closes.
        force: ceiling on the force of each finger [N], 0.15 to 16.1.
    """

    t: float
    gap: float
    force: float


@dataclass(frozen=True, slots=True)
class CameraInfo:
    """A pinhole camera.

    Attributes:
        name: `"head"`, `"left_hand"` or `"right_hand"`.
        width, height: image size [px].
        fx, fy, cx, cy: intrinsics [px]; a pixel's centre has integer coordinates.
        near, far: depth range outside which the sensor returns no depth [m].
        rate: frames per second [Hz].
    """

    name: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    near: float
    far: float
    rate: float

    def with_lens(self, focal: float, right: float, down: float) -> CameraInfo:
        """Return the camera with `focal` times its focal lengths, and its principal point moved [px]."""
        return replace(self, fx=focal * self.fx, fy=focal * self.fy, cx=self.cx + right, cy=self.cy + down)


@dataclass(frozen=True, slots=True)
class RgbdImage:
    """One RGB-D frame, depth aligned to colour.

    Attributes:
        t: time of exposure [s].
        info: the camera.
        rgb: (height, width, 3) uint8.
        depth: (height, width) float32 distance along the optical axis [m]; 0 where invalid.
        T_odom_optical: (4, 4) pose of the optical frame in odom by the nominal calibration, the measured joints and
            the base estimate: what the robot believes, not where the camera is.
    """

    t: float
    info: CameraInfo
    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    T_odom_optical: Array


@dataclass(frozen=True, slots=True)
class Detection:
    """One object in one image.

    Attributes:
        label: class name.
        score: confidence, 0 to 1.
        box: (4,) x_min, y_min, x_max, y_max [px].
        center: (2,) image point of the object's centre, x, y [px].
    """

    label: str
    score: float
    box: Array
    center: Array


@dataclass(frozen=True, slots=True)
class Mask:
    """Some pixels of an image.

    Attributes:
        pixels: (h, w) bool, a crop of the image: which pixels belong.
        x, y: column and row of the crop's upper left pixel in the image [px].
    """

    pixels: NDArray[np.bool_]
    x: int
    y: int


@dataclass(frozen=True, slots=True)
class LocalizedObject:
    """A detection lifted into space.

    Attributes:
        detection: where it is in the image.
        t: time of the frame [s].
        position: (3,) the object's position in odom [m]: the surface point seen at its centre.
        points: (n, 3) its point cloud in odom [m].
        mask: the n pixels that `points` were lifted from, row by row; None where the localizer does not say. Of one
            that knows boxes only, they are those of the box.
    """

    detection: Detection
    t: float
    position: Array
    points: Array
    mask: Mask | None = None

    @property
    def label(self) -> str:
        """The class name."""
        return self.detection.label


@dataclass(frozen=True, slots=True)
class Twist:
    """A command for the lower body.

    Attributes:
        vx, vy, wz: velocity in base_link [m/s], [rad/s].
        height: of base_link above the ground [m]; None or NaN is the lower body's own. It holds until the next command.
    """

    vx: float = 0.0
    vy: float = 0.0
    wz: float = 0.0
    height: float | None = None


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

    def matrix(self) -> Array:
        """Return it as a (4, 4) pose at height 0."""
        T = np.eye(4)
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        T[:2, :2], T[:2, 3] = ((c, -s), (s, c)), (self.x, self.y)
        return T

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

    def toward(self, other: PlanarPose, share: float) -> PlanarPose:
        """Return the pose that is `share` of the way to `other`, both given in one frame; they are near each other."""
        step = self.to(other)
        return self @ PlanarPose(share * step.x, share * step.y, share * step.yaw)


def wrap(angle: float) -> float:
    """Return `angle` [rad] between -pi and pi."""
    return math.remainder(angle, math.tau)


@dataclass(frozen=True, slots=True)
class BaseEstimate:
    """Where the base is, as far as the robot can tell.

    Attributes:
        t: time stamp [s].
        T_odom_base: (4, 4) pose of base_link in odom.
        velocity: (3,) linear velocity of base_link in odom [m/s].
        height: height of base_link above the soles of the planted feet [m]; 0 where no foot carries the robot.
        contact: (2,) probability that the left and the right foot carry load, 0 to 1.
        stale: whether too little was measured for too long to rely on `velocity`.
    """

    t: float
    T_odom_base: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    height: float = 0.0
    contact: Array = field(default_factory=lambda: np.zeros(2))
    stale: bool = False


@dataclass(frozen=True, slots=True)
class PalmTargets:
    """Where the two grasp frames (`left_gripper`, `right_gripper`: z approach, y closing) shall be.

    Attributes:
        t: time stamp [s].
        left, right: (4, 4) pose of that hand's grasp frame in odom; None leaves the arm where it is.
        torso: angle that the waist is to have where the hands leave it free [rad], for controllers that can choose;
            None is their own.
    """

    t: float
    left: Array | None = None
    right: Array | None = None
    torso: float | None = None
