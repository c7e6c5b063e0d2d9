"""The base of a robot in a hoist: it stays where it hangs, and tilts as its IMU says."""

from __future__ import annotations

import math

import numpy as np

from golem.robots.model.table import JOINT_NAMES
from golem.types import Array, BaseEstimate, LowState

_TORSO = JOINT_NAMES.index("torso_joint")


class TetherEstimator:
    """Position fixed at the origin of odom, orientation from the IMU with the torso's yaw undone."""

    def __init__(self) -> None:
        """Start without a heading."""
        self._heading = 0.0

    def reset(self, state: LowState) -> None:
        """Take the present heading of base_link as zero."""
        self._heading = 0.0
        R = self._rotation(state)
        self._heading = math.atan2(R[1, 0], R[0, 0])

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        """Return the pose; see `BaseEstimator`."""
        T = np.eye(4)
        T[:3, :3] = self._rotation(state)
        return BaseEstimate(state.t, T)

    def _rotation(self, state: LowState) -> Array:
        """Return the (3, 3) rotation of base_link in odom: the IMU's, less the torso joint's about their common z."""
        w, x, y, z = state.imu.quat.tolist()
        # q_z(-heading) q q_z(-torso): both turns are about z, so they mix w with z and x with y by their sum and
        # their difference.
        torso = float(state.q[_TORSO])
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
