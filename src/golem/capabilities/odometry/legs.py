"""Odometry by the legs alone: the base estimate, its pose counted from where the robot stood first."""

from __future__ import annotations

import numpy as np

from golem.capabilities.odometry.base import NO_COVARIANCE, Ignores, OdometryEstimate, OdomOrigin, Source, lidar_in_base
from golem.interfaces.lidar import LegOdometry


class Legs(Ignores):
    """The stack's base estimator as odometry; see `LidarOdometry`. It is silent while that is stale."""

    sources: tuple[Source, ...] = ("legs",)

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._origin = OdomOrigin()
        self._newest: OdometryEstimate | None = None
        self.why = "The legs have not reported yet."

    def add_legs(self, legs: LegOdometry) -> None:
        numbers = np.concatenate([legs.T_odom_base.ravel(), legs.velocity, legs.rate, [legs.t, legs.waist]])
        if not np.isfinite(numbers).all() or (self._newest is not None and legs.t <= self._newest.t):
            return
        if legs.stale:
            self._newest, self.why = None, "The base estimate is stale."
            return
        T = self._origin(legs.T_odom_base)
        self._newest = OdometryEstimate(
            legs.t, T, T[:3, :3] @ legs.velocity, legs.rate, NO_COVARIANCE, lidar_in_base(legs.waist)
        )
        self.why = ""

    def estimate(self) -> OdometryEstimate | None:
        return self._newest
