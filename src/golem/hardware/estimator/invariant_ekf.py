"""The right-invariant EKF as a base estimator: IMU on the torso, legs below the waist, one contract."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from golem.finite import check_measured
from golem.hardware.estimator import feet_kernel
from golem.hardware.estimator.attitude import Attitude
from golem.hardware.estimator.feet import Feet, FeetConfig, LevelFloor
from golem.hardware.estimator.invariant import InvariantConfig, InvariantFilter
from golem.robots.model.imu_mount import TORSO, turned_rate
from golem.robots.model.spatial import skew
from golem.robots.model.table import FRAMES
from golem.types import Array, BaseEstimate, LowState

_IMU = FRAMES["imu_link"].T_parent_frame[:3, 3]
"""(3,) the IMU in the torso link [m], whose origin is that of base_link and whose axes are the IMU's."""
_LEVER = skew(_IMU)


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


class InvariantEKF:
    """A right-invariant EKF in the frame of the IMU; see `BaseEstimator` and `invariant`.

    The waist turns about an axis through the origin of base_link, which therefore is a fixed point of the torso: from
    IMU to base_link there is a constant lever arm, and the joint only turns the axes and the feet.
    """

    def __init__(self, config: InvariantEKFConfig | None = None) -> None:
        """Start at rest."""
        self.config = config or InvariantEKFConfig()
        self._attitude = Attitude()
        self._feet = Feet(self.config.feet)
        self._filter = InvariantFilter(self.config.filter)
        self._local: Array = np.zeros((2, 3))
        self._floor = LevelFloor()
        self._grounded = False
        self._unmeasured = 0.0

    def reset(self, state: LowState) -> None:
        """Start at rest above the origin of odom, heading zero."""
        self._attitude.reset(state)
        self._feet.reset()
        R = self._attitude.rotation(state) @ _waist(state)
        self._filter.reset(R, R @ _IMU)
        self._local = np.zeros((2, 3))
        self._floor.reset()
        self._grounded = False
        self._unmeasured = 0.0

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        """Fuse one measurement; see `BaseEstimator`."""
        check_measured(state)
        filter, feet = self._filter, self._feet
        waist = _waist(state)
        up = waist @ filter.R[2]
        omega = turned_rate(state.imu.gyro - filter.bias[0], float(state.q[TORSO]), float(state.dq[TORSO]))
        feet.step(state, up, omega, dt)
        filter.predict(state.imu.gyro, state.imu.acc, feet.weight, dt)

        points, shift = feet_kernel.in_torso(feet.points, feet.rotations, feet.local - self._local, waist)
        points -= _IMU
        self._local = feet.local
        R = filter.R @ waist.T
        own = self._attitude.rotation(state)
        # The turn about the vertical that takes one rotation to the other, as nearly as any.
        excess = math.atan2(
            R[1, 0] * own[0, 0] - R[0, 0] * own[1, 0], R[0, 0] * own[0, 0] + R[1, 0] * own[1, 0]
        )
        believed = filter.update(points, feet.weight, shift, excess, not self._grounded)
        self._grounded = self._grounded or bool(believed.any())
        self._unmeasured = 0.0 if believed.any() else self._unmeasured + dt

        R_imu = filter.R
        velocity = filter.x[0] + R_imu @ (_LEVER @ (state.imu.gyro - filter.bias[0]))
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = R_imu @ waist.T, filter.x[1] - R_imu @ _IMU
        height, T[2, 3] = self._floor.step(float(velocity[2]), T[2, :3], feet, dt)
        return BaseEstimate(
            t=state.t,
            T_odom_base=T,
            velocity=velocity,
            height=height,
            contact=feet.contact,
            stale=not self._floor.seen or self._unmeasured > self.config.stale_after,
        )


def _waist(state: LowState) -> Array:
    """Return the (3, 3) rotation of the torso in base_link."""
    angle = float(state.q[TORSO])
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
