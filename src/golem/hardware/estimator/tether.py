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
        w, x, y, z = state.imu.quat
        torso = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        return _about_z(-self._heading) @ torso @ _about_z(-float(state.q[_TORSO]))


def _about_z(angle: float) -> Array:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
