"""The base of a robot in a hoist: it stays where it hangs, and tilts as its IMU says."""

from __future__ import annotations

import numpy as np

from golem.finite import check_finite
from golem.hardware.estimator.attitude import Attitude
from golem.types import BaseEstimate, LowState


class TetherEstimator:
    """Position fixed at the origin of odom, orientation from the IMU with the torso's yaw undone. Never stale."""

    requires = ("hoist",)

    def __init__(self) -> None:
        """Start without a heading."""
        self._attitude = Attitude()

    def reset(self, state: LowState) -> None:
        """Take the present heading of base_link as zero."""
        self._attitude.reset(state)

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        """Return the pose; see `BaseEstimator`."""
        check_finite("the IMU's quaternion", state.imu.quat)
        T = np.eye(4)
        T[:3, :3] = self._attitude.rotation(state)
        return BaseEstimate(state.t, T)
