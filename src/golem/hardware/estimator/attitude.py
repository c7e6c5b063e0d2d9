"""Orientation and angular rate of base_link from the torso's IMU, the waist joint between them undone."""

from __future__ import annotations

import math

import numpy as np

from golem.robots.model.table import JOINT_INDEX
from golem.types import Array, LowState

TORSO = JOINT_INDEX["torso_joint"]
"""Motor index of the waist: the only joint between base_link and the IMU, about their common z."""


class Attitude:
    """The orientation of base_link in odom, whose heading is zero at the reset."""

    def __init__(self) -> None:
        """Start without a heading."""
        self._heading = 0.0

    def reset(self, state: LowState) -> None:
        """Take the present heading of base_link as zero."""
        self._heading = 0.0
        R = self.rotation(state)
        self._heading = math.atan2(R[1, 0], R[0, 0])

    def rotation(self, state: LowState) -> Array:
        """Return the (3, 3) rotation of base_link in odom: the IMU's, less the torso joint's."""
        w, x, y, z = state.imu.quat.tolist()
        # q_z(-heading) q q_z(-torso): both turns are about z, so they mix w with z and x with y by their sum and
        # their difference.
        torso = float(state.q[TORSO])
        add, sub = 0.5 * (self._heading + torso), 0.5 * (self._heading - torso)
        c, s = math.cos(add), math.sin(add)
        w, z = c * w + s * z, c * z - s * w
        c, s = math.cos(sub), math.sin(sub)
        x, y = c * x + s * y, c * y - s * x
        k = 2.0 / (w * w + x * x + y * y + z * z)
        return np.array(
            [
                [1.0 - k * (y * y + z * z), k * (x * y - w * z), k * (x * z + w * y)],
                [k * (x * y + w * z), 1.0 - k * (x * x + z * z), k * (y * z - w * x)],
                [k * (x * z - w * y), k * (y * z + w * x), 1.0 - k * (x * x + y * y)],
            ]
        )


def base_rate(state: LowState) -> Array:
    """Return the (3,) angular rate of base_link, in base_link [rad/s]: the gyro's, less the torso joint's."""
    torso = float(state.q[TORSO])
    c, s = math.cos(torso), math.sin(torso)
    x, y, z = state.imu.gyro.tolist()
    return np.array([c * x - s * y, s * x + c * y, z - float(state.dq[TORSO])])
