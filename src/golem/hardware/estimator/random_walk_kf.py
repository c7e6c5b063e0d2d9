"""The paper's base estimator: orientation from the IMU, velocity from planted feet, position by integration.

The random-walk Kalman filter on the base velocity, for one robot or for many at once (paper, eq. rwkf and legodom).

A foot that stands still says how the base moves: minus the velocity of the sole relative to the base. The state is the
velocity in a world-fixed frame, a random walk; every planted foot measures it directly. All noise is isotropic, so the
covariance is one number per robot and both updates are a few elementwise operations.

Both feet are judged against the prediction and then fused together, not one after the other: left and right are
treated alike, and a mirrored measurement gives the mirrored estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from golem.finite import finite_state
from golem.hardware.estimator.attitude import GYRO_BIAS, Attitude, base_rotation, track_bias
from golem.hardware.estimator.compiled import CompiledEstimator
from golem.hardware.estimator.feet import FEET, FLOOR, FeetConfig, forget_feet, level_floor, put_feet, sense_feet
from golem.kernels import njit
from golem.native import ORDINARY, UNUSUAL, CompiledStage, Record, Records, new_record, shared, stage_code, view
from golem.robots.model.imu_mount import TORSO, turn_to_base
from golem.types import Array, LowState


@dataclass(frozen=True, slots=True)
class RandomWalkConfig:
    """Noise and gates of the filter.

    Attributes:
        walk: how far the velocity wanders in a second, standard deviation [m/s / sqrt(s)].
        foot_noise: standard deviation per axis of the velocity of a fully loaded foot [m/s]; a foot of weight w has
            `foot_noise / sqrt(w)`.
        min_weight: a foot of less weight measures nothing.
        gate: squared Mahalanobis distance up to which a foot is believed as it is: 11.34, the 99 % quantile of
            chi-square with three degrees of freedom. Beyond it the variance of the foot grows with the distance.
        reject: squared distance beyond which a foot is not believed at all.
        start: standard deviation of the velocity after a reset [m/s].
    """

    walk: float = 0.5
    foot_noise: float = 0.05
    min_weight: float = 0.05
    gate: float = 11.34
    reject: float = 113.4
    start: float = 0.1


FILTER = np.dtype([("options", "f8", (5,)), ("velocity", "f8", (3,)), ("variance", "f8"), ("unmeasured", "f8")])
"""Options, see `filter_options`, and memory of `fuse`, of one robot."""


def filter_options(config: RandomWalkConfig) -> Array:
    """Return the (5,) numbers of `config` that `fuse` takes."""
    return np.array([config.walk, config.foot_noise, config.min_weight, config.gate, config.reject])


@njit(cache=True, nogil=True)
def fuse(m: Record, measured: Array, weight: Array, dt: float) -> Array:
    """Predict by `dt` [s] and fuse what the feet measure; return what each contributed, (2,) [s^2/m^2], 0 for none.

    Args:
        m: the memory of one robot, a `FILTER`.
        measured: (2, 3) the velocity that each foot implies if it stands still [m/s], world axes.
        weight: (2,) how far each foot is to be believed, 0 to 1, from `feet.contact`.
        dt: time since the previous estimate [s].
    """
    walk, foot_noise, min_weight = m.options[0], m.options[1], m.options[2]
    gate, reject = m.options[3], m.options[4]
    prior = m.variance + walk * walk * dt
    information, step, total = np.empty(2), np.empty((2, 3)), 0.0
    for k in range(2):
        square = 0.0
        for a in range(3):
            step[k, a] = measured[k, a] - m.velocity[a]
            square += step[k, a] * step[k, a]
        noise = foot_noise * foot_noise / max(weight[k], min_weight)
        distance = square / (prior + noise)
        believed = weight[k] >= min_weight and distance <= reject
        grown = noise if distance <= gate else noise * distance / gate
        information[k] = (1.0 if believed else 0.0) / grown
        total += information[k]
    m.variance = prior / (1.0 + prior * total)
    for a in range(3):
        m.velocity[a] += m.variance * (information[0] * step[0, a] + information[1] * step[1, a])
    m.unmeasured = 0.0 if total > 0.0 else m.unmeasured + dt
    return information


@njit(cache=True, nogil=True)
def _fuse_all(memories: Records, measured: Array, weight: Array, dt: float) -> None:
    for i in range(len(memories)):
        fuse(memories[i], measured[i], weight[i], dt)


class RandomWalk:
    """`fuse` for `shape` robots."""

    def __init__(self, config: RandomWalkConfig, shape: tuple[int, ...] = ()) -> None:
        self.config = config
        self._memory = np.zeros(shape, FILTER)
        self._memory["options"] = filter_options(config)
        self._memory["variance"] = config.start**2

    @property
    def velocity(self) -> Array:
        """(*shape, 3) estimate [m/s]."""
        return self._memory["velocity"].copy()

    @property
    def variance(self) -> Array:
        """(*shape,) its variance per axis [m^2/s^2]."""
        return self._memory["variance"].copy()

    @property
    def unmeasured(self) -> Array:
        """(*shape,) time since a foot was last believed [s]."""
        return self._memory["unmeasured"].copy()

    def reset(self, where: NDArray[np.bool_] | None = None) -> None:
        """Put the robots `where` (*shape,) back to rest; None is all."""
        chosen = ... if where is None else where
        for name, value in (("velocity", 0.0), ("variance", self.config.start**2), ("unmeasured", 0.0)):
            self._memory[name][chosen] = value

    def step(self, measured: Array, weight: Array, dt: float) -> Array:
        """Advance by `dt` [s] with `measured` (*shape, 2, 3) and `weight` (*shape, 2); return `velocity`."""
        _fuse_all(self._memory.reshape(-1), measured.reshape(-1, 2, 3), weight.reshape(-1, 2), dt)
        return self.velocity


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

    # What each foot implies if it stands still: -R [omega x p + J dq], eq. (legodom) of the paper.
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


@stage_code
def _code(record: int, memory: int) -> int:
    r = shared(record)
    if not finite_state(r):
        return UNUSUAL
    random_walk(r, _memory_at(memory))
    return ORDINARY


class RandomWalkKF(CompiledEstimator):
    """A random-walk Kalman filter on the velocity of base_link; see `BaseEstimator`.

    The horizontal position is integrated open loop; for the height see `level_floor`.
    """

    def __init__(self, config: RandomWalkKFConfig | None = None) -> None:
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
