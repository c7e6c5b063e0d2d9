"""Orientation of base_link from the torso's IMU, the waist joint between them undone, and the bias of its gyro."""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.native import Record
from golem.robots.model.imu_mount import TORSO
from golem.types import Array, LowState


@njit(cache=True, nogil=True)
def base_rotation(quat: Array, torso: float, heading: float, out: Array) -> None:
    """Write the rotation of base_link in odom into `out`, (3, 3) or larger.

    Args:
        quat: (4,) orientation of the IMU, wxyz.
        torso: position of the waist joint [rad].
        heading: of odom in the IMU's world [rad].
        out: is filled.
    """
    w, x, y, z = quat[0], quat[1], quat[2], quat[3]
    # q_z(-heading) q q_z(-torso): both turns are about z, so they mix w with z and x with y by their sum and
    # their difference.
    add, sub = 0.5 * (heading + torso), 0.5 * (heading - torso)
    c, s = math.cos(add), math.sin(add)
    w, z = c * w + s * z, c * z - s * w
    c, s = math.cos(sub), math.sin(sub)
    x, y = c * x + s * y, c * y - s * x
    k = 2.0 / (w * w + x * x + y * y + z * z)
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - k * (y * y + z * z), k * (x * y - w * z), k * (x * z + w * y)
    out[1, 0], out[1, 1], out[1, 2] = k * (x * y + w * z), 1.0 - k * (x * x + z * z), k * (y * z - w * x)
    out[2, 0], out[2, 1], out[2, 2] = k * (x * z - w * y), k * (y * z + w * x), 1.0 - k * (x * x + y * y)


class Attitude:
    """The orientation of base_link in odom, which has the `heading` in the IMU's world [rad] of the reset."""

    def __init__(self) -> None:
        self.heading = 0.0

    def reset(self, state: LowState) -> None:
        """Take the present heading of base_link as zero."""
        self.heading = 0.0
        R = self.rotation(state)
        self.heading = math.atan2(R[1, 0], R[0, 0])

    def rotation(self, state: LowState) -> Array:
        """Return the (3, 3) rotation of base_link in odom: the IMU's, less the torso joint's."""
        R = np.empty((3, 3))
        base_rotation(state.imu.quat, float(state.q[TORSO]), self.heading, R)
        return R


GYRO_BIAS = np.dtype([("value", "f8", (3,)), ("before", "f8", (4,)), ("has_before", "i8"), ("elapsed", "f8")])
"""What `track_bias` remembers; zeros at the start."""
MEMORY = 10.0
"""Time over which gyro and orientation are compared, once so much has passed [s]."""
START = 1.0
"""Time over which they are at first [s]: the noise of one orientation counts over it."""


@njit(cache=True, nogil=True)
def track_bias(m: Record, quat: Array, gyro: Array, dt: float) -> None:
    """Take the sample `quat` (4,) wxyz, `gyro` (3,) [rad/s], `dt` [s] after the one before; `m` is a `GYRO_BIAS`."""
    w, x, y, z = quat[0], quat[1], quat[2], quat[3]
    if m.has_before:
        # Vector part of q_before^-1 q: half the turn, in the IMU's axes.
        a, b, c, d = m.before[0], m.before[1], m.before[2], m.before[3]
        sign = 1.0 if a * w + b * x + c * y + d * z >= 0.0 else -1.0
        m.elapsed += dt
        share, twice = dt / min(max(m.elapsed, START), MEMORY), 2.0 * sign / dt
        m.value[0] += share * (gyro[0] - twice * (a * x - b * w - c * z + d * y) - m.value[0])
        m.value[1] += share * (gyro[1] - twice * (a * y - c * w - d * x + b * z) - m.value[1])
        m.value[2] += share * (gyro[2] - twice * (a * z - d * w - b * y + c * x) - m.value[2])
    m.has_before = 1
    m.before[0], m.before[1], m.before[2], m.before[3] = w, x, y, z
