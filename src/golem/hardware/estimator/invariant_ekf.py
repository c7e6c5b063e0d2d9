"""The right-invariant EKF as a base estimator: IMU on the torso, legs below the waist, one contract."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from golem.finite import finite_state
from golem.hardware.estimator.attitude import Attitude, base_rotation
from golem.hardware.estimator.compiled import CompiledEstimator
from golem.hardware.estimator.feet import FEET, FLOOR, FeetConfig, forget_feet, level_floor, put_feet, sense_feet
from golem.hardware.estimator.feet_kernel import in_torso
from golem.hardware.estimator.invariant import INVARIANT, InvariantConfig, InvariantFilter, predict, update
from golem.kernels import cfunc, njit
from golem.native import ORDINARY, STAGE, UNUSUAL, CompiledStage, Record, new_record, shared, view
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.robots.model.table import FRAMES
from golem.types import Array, LowState

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


def _step(record: int, memory: int) -> int:
    r = shared(record)
    if not finite_state(r):
        return UNUSUAL
    invariant_ekf(r, _memory_at(memory))
    return ORDINARY


@cache
def _code() -> Any:
    return cfunc(STAGE, cache=True)(_step)


class InvariantEKF(CompiledEstimator):
    """A right-invariant EKF in the frame of the IMU; see `BaseEstimator` and `invariant`.

    The waist turns about an axis through the origin of base_link, which therefore is a fixed point of the torso: from
    IMU to base_link there is a constant lever arm, and the joint only turns the axes and the feet.
    """

    def __init__(self, config: InvariantEKFConfig | None = None) -> None:
        """Start at rest."""
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
