"""The right-invariant EKF as a base estimator: IMU on the torso, legs below the waist, one contract.

The right-invariant extended Kalman filter of a walking robot (Hartley et al., IJRR 2020), without its sensors.

State: the IMU's rotation R, velocity v and position p, the two contact points d (all in odom), and the biases of gyro
and accelerometer. The error is the invariant one, X_est = exp(xi) X, in the order

    xi = (rotation, v, p, d_left, d_right, gyro bias, accelerometer bias), 21 numbers, axes of odom,

so that prediction and kinematic measurement are linearised alike wherever the robot is and however it turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from golem.finite import finite_state
from golem.hardware.estimator.attitude import Attitude, base_rotation
from golem.hardware.estimator.compiled import CompiledEstimator
from golem.hardware.estimator.feet import FEET, FLOOR, FeetConfig, forget_feet, level_floor, put_feet, sense_feet
from golem.hardware.estimator.feet_kernel import in_torso
from golem.hardware.estimator.invariant_kernel import SIZE, predict, update
from golem.kernels import njit
from golem.native import ORDINARY, UNUSUAL, CompiledStage, Record, Records, new_record, shared, stage_code, view
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.robots.model.spatial import skew
from golem.robots.model.table import FRAMES
from golem.types import Array, LowState

_ROTATION, _V, _P = slice(0, 3), slice(3, 6), slice(6, 9)
_GYRO, _ACC = slice(15, 18), slice(18, 21)
_HEADING = 2
"""Index of the error about the vertical."""


@dataclass(frozen=True, slots=True)
class InvariantConfig:
    """Noise, gates and initial uncertainty; densities unless said otherwise.

    Attributes:
        gyro_noise, acc_noise: white noise [rad/sqrt(s)], [m/s/sqrt(s)]. The twin's IMU has 1.7e-4 and 1.3e-3
            (0.0039 rad/s and 0.028 m/s^2 per sample at 500 Hz); the rest is for what a stiff model leaves out.
        gyro_walk, acc_walk: how the biases wander [rad/s/sqrt(s)], [m/s^2/sqrt(s)].
        contact_noise: how a fully loaded foot wanders [m/sqrt(s)]; a foot of weight w does by 1/sqrt(w) of that.
        foot_noise: standard deviation of a foot's position relative to the IMU, per sample [m]: the encoders' noise
            over the length of the leg.
        heading_noise: the same of the IMU's own heading [rad]. Feet and accelerometer say nothing about heading,
            whose error would grow with the bias of the gyro.
        rest_noise: the same of the velocity of a robot whose feet have not carried it yet: it hangs [m/s].
        min_weight: a foot of less weight is in the air.
        gate: squared Mahalanobis distance up to which a foot is believed as it is (chi-square, 3 degrees, 99 %).
        reject: squared distance beyond which a foot has slipped: it is put where it is now seen.
        tilt, velocity, gyro_bias, acc_bias: standard deviations at the reset [rad], [m/s], [rad/s], [m/s^2].
    """

    gyro_noise: float = 1e-3
    acc_noise: float = 1e-2
    gyro_walk: float = 1e-5
    acc_walk: float = 1e-3
    contact_noise: float = 3e-3
    foot_noise: float = 3e-3
    heading_noise: float = 0.02
    rest_noise: float = 0.3
    min_weight: float = 0.05
    gate: float = 11.34
    reject: float = 113.4
    tilt: float = 0.01
    velocity: float = 0.1
    gyro_bias: float = 0.005
    acc_bias: float = 0.1


INVARIANT = np.dtype(
    [
        ("R", "f8", (3, 3)),
        ("x", "f8", (4, 3)),
        ("bias", "f8", (2, 3)),
        ("P", "f8", (SIZE, SIZE)),
        ("planted", "i8", (2,)),
        ("noise", "f8", (2,)),
        ("wander", "f8", (SIZE,)),
        ("contact_noise", "f8"),
        ("numbers", "f8", (6,)),
    ]
)
"""State and options of the filter; see `InvariantFilter`. `noise` are the squared densities of gyro and accelerometer,
`wander` is the variance that each number of the error gains per second, `contact_noise` that of a contact point.
`numbers` are the least weight, the variances of a foot, of the heading and of the rest, gate and rejection."""


class InvariantFilter:
    """The filter.

    Attributes:
        memory: all it knows; the next five are views of it.
        R: (3, 3) rotation of the IMU in odom.
        x: (4, 3) velocity of the IMU, its position, the left and the right contact point, in odom [m/s], [m].
        bias: (2, 3) of the gyro [rad/s] and the accelerometer [m/s^2], in the IMU's axes.
        P: (21, 21) covariance of the invariant error.
        planted: (2,) whether the left and the right contact point are in use, 0 or 1.
    """

    def __init__(self, config: InvariantConfig, memory: Records | None = None) -> None:
        """Begin at the origin of odom, in `memory`, an `INVARIANT`, or in one of its own."""
        self.config = config
        self.memory = memory = new_record(INVARIANT) if memory is None else memory
        c = config
        memory["noise"] = c.gyro_noise**2, c.acc_noise**2
        memory["wander"][0, _GYRO], memory["wander"][0, _ACC] = c.gyro_walk**2, c.acc_walk**2
        memory["contact_noise"] = c.contact_noise**2
        memory["numbers"] = (
            c.min_weight, c.foot_noise**2, c.heading_noise**2, c.rest_noise**2, c.gate, c.reject
        )  # fmt: skip
        self.R: Array = memory["R"][0]
        self.x: Array = memory["x"][0]
        self.bias: Array = memory["bias"][0]
        self.P: Array = memory["P"][0]
        self.planted: NDArray[np.int64] = memory["planted"][0]
        self.reset(np.eye(3), np.zeros(3))

    def reset(self, R: Array, p: Array) -> None:
        """Begin at rest, with the IMU's rotation `R` (3, 3) and position `p` (3,) [m] in odom, feet in the air."""
        c = self.config
        self.R[:], self.x[:], self.bias[:], self.planted[:] = R, 0.0, 0.0, 0
        self.x[1] = p
        spread = np.zeros(SIZE)
        spread[:_HEADING], spread[_V] = c.tilt, c.velocity
        spread[_GYRO], spread[_ACC] = c.gyro_bias, c.acc_bias
        # An invariant error of the rotation turns about the origin of odom, and moves what is away from it.
        lever = np.eye(SIZE)
        lever[_P, _ROTATION] = skew(p)
        self.P[:] = lever @ np.diag(spread**2) @ lever.T

    def predict(self, gyro: Array, acc: Array, weight: Array, dt: float) -> None:
        """Advance by one IMU sample.

        Args:
            gyro: (3,) measured angular rate [rad/s].
            acc: (3,) measured specific force [m/s^2].
            weight: (2,) how far each foot is to be believed to stand still.
            dt: time since the previous sample [s].
        """
        predict(self.memory[0], gyro, acc, weight, dt)

    def update(self, points: Array, weight: Array, shift: Array, heading: float, hanging: bool) -> NDArray[np.bool_]:
        """Fuse where the feet are seen, and the heading; return (2,) which feet were believed.

        Args:
            points: (2, 3) contact points, in the IMU's frame [m].
            weight: (2,) how far each foot is to be believed to stand still.
            shift: (2, 3) by how much the contact points have moved within the soles since the last call, axes of the
                IMU [m].
            heading: by how much the estimated heading exceeds the IMU's own [rad].
            hanging: whether to take the robot as being at rest.
        """
        return update(self.memory[0], points, weight, shift, heading, hanging)


_IMU = tuple(FRAMES["imu_link"].T_parent_frame[:3, 3].tolist())
"""The IMU in the torso link [m], whose origin is that of base_link and whose axes are the IMU's."""


@dataclass(frozen=True, slots=True)
class InvariantEKFConfig:
    """Options of `InvariantEKF`.

    Attributes:
        filter: noise and gates of the filter.
        feet: how contacts are found.
        stale_after: time without a believed foot after which the estimate is stale [s]; before the first one it always
            is.
    """

    filter: InvariantConfig = field(default_factory=InvariantConfig)
    feet: FeetConfig = field(default_factory=FeetConfig)
    stale_after: float = 0.2


INVARIANT_EKF = np.dtype(
    [
        ("heading", "f8"),
        ("feet", FEET),
        ("filter", INVARIANT),
        ("local", "f8", (2, 3)),
        ("floor", FLOOR),
        ("grounded", "i8"),
        ("unmeasured", "f8"),
        ("stale_after", "f8"),
    ]
)
"""Options and memory of the estimator."""
_memory_at = view(INVARIANT_EKF)


@njit(cache=True, nogil=True)
def waist_rotation(angle: float) -> Array:
    """Return the (3, 3) rotation of the torso in base_link when the waist joint is at `angle` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    out = np.zeros((3, 3))
    out[0, 0] = out[1, 1] = c
    out[0, 1], out[1, 0], out[2, 2] = -s, s, 1.0
    return out


@njit(cache=True, nogil=True)
def invariant_ekf(r: Record, m: Record) -> None:
    """Fuse the state in the shared record `r`; `m` is an `INVARIANT_EKF`."""
    feet, filter, T, dt = m.feet, m.filter, r.T_odom_base, r.dt
    waist = waist_rotation(r.q[TORSO])
    up, gyro, omega = np.zeros(3), np.empty(3), np.empty(3)
    for a in range(3):
        for b in range(3):
            up[a] += waist[a, b] * filter.R[2, b]
        gyro[a] = r.gyro[a] - filter.bias[0, a]
    turn_to_base(gyro, r.q[TORSO], r.dq[TORSO], omega)
    sense_feet(feet, r.q, r.dq, r.tau, up, omega, dt)
    predict(filter, r.gyro, r.acc, feet.weight, dt)

    moved = np.empty((2, 3))
    for k in range(2):
        for a in range(3):
            moved[k, a] = feet.local[k, a] - m.local[k, a]
            m.local[k, a] = feet.local[k, a]
    points, shift = in_torso(feet.points, feet.motion.rotations, moved, waist)
    for k in range(2):
        for a in range(3):
            points[k, a] -= _IMU[a]
    _pose(filter, waist, T)
    own = np.empty((3, 3))
    base_rotation(r.quat, r.q[TORSO], m.heading, own)
    # The turn about the vertical that takes one rotation to the other, as nearly as any.
    excess = math.atan2(T[1, 0] * own[0, 0] - T[0, 0] * own[1, 0], T[0, 0] * own[0, 0] + T[1, 0] * own[1, 0])
    believed = update(filter, points, feet.weight, shift, excess, m.grounded == 0)
    if believed[0] or believed[1]:
        m.grounded, m.unmeasured = 1, 0.0
    else:
        m.unmeasured += dt

    _pose(filter, waist, T)
    for a in range(3):
        gyro[a] = r.gyro[a] - filter.bias[0, a]
    lever = np.empty(3)
    lever[0] = _IMU[1] * gyro[2] - _IMU[2] * gyro[1]
    lever[1] = _IMU[2] * gyro[0] - _IMU[0] * gyro[2]
    lever[2] = _IMU[0] * gyro[1] - _IMU[1] * gyro[0]
    for a in range(3):
        r.velocity[a] = filter.x[0, a]
        for b in range(3):
            r.velocity[a] += filter.R[a, b] * lever[b]
        up[a] = T[2, a]
    r.height = level_floor(m.floor, r.velocity[2], up, feet, dt)
    T[2, 3] = m.floor.z
    for k in range(2):
        r.contact[k] = feet.contact[k]
    r.stale = m.floor.seen == 0 or m.unmeasured > m.stale_after
    r.base_t = r.state_t


@njit(cache=True, nogil=True)
def _pose(filter: Record, waist: Array, T: Array) -> None:
    """Write the pose of base_link in odom into `T` (4, 4)."""
    for a in range(3):
        T[a, 3], T[3, a] = filter.x[1, a], 0.0
        for b in range(3):
            T[a, 3] -= filter.R[a, b] * _IMU[b]
            T[a, b] = 0.0
            for c in range(3):
                T[a, b] += filter.R[a, c] * waist[b, c]
    T[3, 3] = 1.0


@stage_code
def _code(record: int, memory: int) -> int:
    r = shared(record)
    if not finite_state(r):
        return UNUSUAL
    invariant_ekf(r, _memory_at(memory))
    return ORDINARY


class InvariantEKF(CompiledEstimator):
    """A right-invariant EKF in the frame of the IMU; see `BaseEstimator` and the head of this file.

    The waist turns about an axis through the origin of base_link, which therefore is a fixed point of the torso: from
    IMU to base_link there is a constant lever arm, and the joint only turns the axes and the feet.
    """

    def __init__(self, config: InvariantEKFConfig | None = None) -> None:
        self.config = config or InvariantEKFConfig()
        super().__init__(CompiledStage(_code(), new_record(INVARIANT_EKF)))
        memory = self.stage.memory
        put_feet(memory["feet"], self.config.feet)
        memory["stale_after"] = self.config.stale_after
        self._filter = InvariantFilter(self.config.filter, memory["filter"])

    def reset(self, state: LowState) -> None:
        """Start at rest above the origin of odom, heading zero."""
        attitude, memory = Attitude(), self.stage.memory
        attitude.reset(state)
        memory["heading"] = attitude.heading
        forget_feet(memory["feet"])
        R = attitude.rotation(state) @ waist_rotation(float(state.q[TORSO]))
        self._filter.reset(R, R @ _IMU)
        memory["local"], memory["floor"] = 0.0, np.zeros(1, FLOOR)
        memory["grounded"], memory["unmeasured"] = 0, 0.0
