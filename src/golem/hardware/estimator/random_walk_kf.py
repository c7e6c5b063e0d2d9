"""The paper's base estimator: orientation from the IMU, velocity from planted feet, position by integration."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from golem.finite import check_measured
from golem.hardware.estimator.attitude import Attitude, GyroBias
from golem.hardware.estimator.feet import Feet, FeetConfig, LevelFloor
from golem.hardware.estimator.random_walk import RandomWalk, RandomWalkConfig, base_velocity
from golem.robots.model.imu_mount import TORSO, base_rate
from golem.types import BaseEstimate, LowState


@dataclass(frozen=True, slots=True)
class RandomWalkKFConfig:
    """Options of `RandomWalkKF`.

    Attributes:
        filter: noise and gates of the velocity filter.
        feet: how contacts are found.
        stale_after: time without a believed foot after which the estimate is stale [s]; before the first one it always
            is.
    """

    filter: RandomWalkConfig = field(default_factory=RandomWalkConfig)
    feet: FeetConfig = field(default_factory=FeetConfig)
    stale_after: float = 0.2


class RandomWalkKF:
    """A random-walk Kalman filter on the velocity of base_link; see `BaseEstimator` and `random_walk`.

    The horizontal position is integrated open loop; for the height see `LevelFloor`.
    """

    def __init__(self, config: RandomWalkKFConfig | None = None) -> None:
        """Start at rest."""
        self.config = config or RandomWalkKFConfig()
        self._attitude = Attitude()
        self._bias = GyroBias()
        self._feet = Feet(self.config.feet)
        self._filter = RandomWalk(self.config.filter)
        self._floor = LevelFloor()
        self._xy = np.zeros(2)

    def reset(self, state: LowState) -> None:
        """Start at rest above the origin of odom, heading zero."""
        self._attitude.reset(state)
        self._bias.reset()
        self._feet.reset()
        self._filter.reset()
        self._floor.reset()
        self._xy = np.zeros(2)

    def step(self, state: LowState, dt: float) -> BaseEstimate:
        """Fuse one measurement; see `BaseEstimator`."""
        check_measured(state)
        R = self._attitude.rotation(state)
        feet = self._feet
        gyro = state.imu.gyro - self._bias.step(state, dt)
        omega = base_rate(gyro, state.q[TORSO], state.dq[TORSO])
        feet.step(state, R[2], omega, dt)
        measured = base_velocity(R, omega, feet.points, feet.rates)
        velocity = self._filter.step(measured, feet.weight, dt)
        self._xy = self._xy + velocity[:2] * dt
        height, z = self._floor.step(float(velocity[2]), R[2], feet, dt)
        T = np.eye(4)
        T[:3, :3] = R
        T[:2, 3], T[2, 3] = self._xy, z
        return BaseEstimate(
            t=state.t,
            T_odom_base=T,
            velocity=velocity,
            height=height,
            contact=feet.contact,
            stale=bool(not self._floor.seen or self._filter.unmeasured > self.config.stale_after),
        )
