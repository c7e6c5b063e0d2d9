"""The paper's base estimator: orientation from the IMU, velocity from planted feet, position by integration."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

from golem.finite import finite_state
from golem.hardware.estimator.attitude import GYRO_BIAS, Attitude, base_rotation, track_bias
from golem.hardware.estimator.compiled import CompiledEstimator
from golem.hardware.estimator.feet import FEET, FLOOR, FeetConfig, forget_feet, level_floor, put_feet, sense_feet
from golem.hardware.estimator.random_walk import FILTER, RandomWalkConfig, filter_options, fuse
from golem.kernels import cfunc, njit
from golem.native import ORDINARY, STAGE, UNUSUAL, CompiledStage, Record, new_record, shared, view
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.types import LowState


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


RANDOM_WALK = np.dtype(
    [
        ("heading", "f8"),
        ("bias", GYRO_BIAS),
        ("feet", FEET),
        ("filter", FILTER),
        ("xy", "f8", (2,)),
        ("floor", FLOOR),
        ("stale_after", "f8"),
    ]
)
"""Options and memory of the estimator."""
_memory_at = view(RANDOM_WALK)


@njit(cache=True, nogil=True)
def random_walk(r: Record, m: Record) -> None:
    """Fuse the state in the shared record `r`; `m` is a `RANDOM_WALK`."""
    T, feet, dt = r.T_odom_base, m.feet, r.dt
    base_rotation(r.quat, r.q[TORSO], m.heading, T)
    track_bias(m.bias, r.quat, r.gyro, dt)
    gyro, omega, up = np.empty(3), np.empty(3), np.empty(3)
    for a in range(3):
        gyro[a] = r.gyro[a] - m.bias.value[a]
        up[a] = T[2, a]
    turn_to_base(gyro, r.q[TORSO], r.dq[TORSO], omega)
    sense_feet(feet, r.q, r.dq, r.tau, up, omega, dt)

    # What each foot implies if it stands still; see `random_walk.base_velocity`.
    measured, moving = np.empty((2, 3)), np.empty(3)
    for k in range(2):
        x, y, z = feet.points[k, 0], feet.points[k, 1], feet.points[k, 2]
        moving[0] = omega[1] * z - omega[2] * y + feet.rates[k, 0]
        moving[1] = omega[2] * x - omega[0] * z + feet.rates[k, 1]
        moving[2] = omega[0] * y - omega[1] * x + feet.rates[k, 2]
        for a in range(3):
            measured[k, a] = -(T[a, 0] * moving[0] + T[a, 1] * moving[1] + T[a, 2] * moving[2])
    fuse(m.filter, measured, feet.weight, dt)

    for a in range(2):
        m.xy[a] += m.filter.velocity[a] * dt
        T[a, 3] = m.xy[a]
    r.height = level_floor(m.floor, m.filter.velocity[2], up, feet, dt)
    T[2, 3] = m.floor.z
    T[3, 0] = T[3, 1] = T[3, 2] = 0.0
    T[3, 3] = 1.0
    for a in range(3):
        r.velocity[a] = m.filter.velocity[a]
    for k in range(2):
        r.contact[k] = feet.contact[k]
    r.stale = m.floor.seen == 0 or m.filter.unmeasured > m.stale_after
    r.base_t = r.state_t


def _step(record: int, memory: int) -> int:
    r = shared(record)
    if not finite_state(r):
        return UNUSUAL
    random_walk(r, _memory_at(memory))
    return ORDINARY


@cache
def _code() -> Any:
    return cfunc(STAGE, cache=True)(_step)


class RandomWalkKF(CompiledEstimator):
    """A random-walk Kalman filter on the velocity of base_link; see `BaseEstimator` and `random_walk`.

    The horizontal position is integrated open loop; for the height see `level_floor`.
    """

    def __init__(self, config: RandomWalkKFConfig | None = None) -> None:
        """Start at rest."""
        self.config = config or RandomWalkKFConfig()
        super().__init__(CompiledStage(_code(), new_record(RANDOM_WALK)))
        memory = self.stage.memory
        put_feet(memory["feet"], self.config.feet)
        memory["filter"]["options"] = filter_options(self.config.filter)
        memory["stale_after"] = self.config.stale_after
        self._rest()

    def reset(self, state: LowState) -> None:
        """Start at rest above the origin of odom, heading zero."""
        self._rest()
        attitude = Attitude()
        attitude.reset(state)
        self.stage.memory["heading"] = attitude.heading

    def _rest(self) -> None:
        memory = self.stage.memory
        memory["bias"] = np.zeros(1, GYRO_BIAS)
        forget_feet(memory["feet"])
        memory["filter"]["velocity"], memory["filter"]["unmeasured"] = 0.0, 0.0
        memory["filter"]["variance"] = self.config.filter.start**2
        memory["xy"] = 0.0
        memory["floor"] = np.zeros(1, FLOOR)
