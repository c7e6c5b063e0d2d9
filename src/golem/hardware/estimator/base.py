"""The contract of a base estimator: IMU and joints in, pose and velocity of base_link in odom out."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from golem.types import BaseEstimate, LowState


@runtime_checkable
class BaseEstimator(Protocol):
    """Estimates the pose of base_link in odom.

    odom is level, and base_link starts above its origin with heading zero. A class that takes the robot to hang or to
    stand says so: `requires = ("hoist",)` or `("ground",)`; a stack whose robot does not is refused.
    """

    def reset(self, state: LowState) -> None:
        """Forget everything; `state` is the first measurement."""
        ...

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        """Fuse one measurement.

        Args:
            state: joints and IMU.
            dt: time since the previous measurement [s].

        Raises:
            GolemError: the measurement is not finite; it is refused rather than believed.
        """
        ...
