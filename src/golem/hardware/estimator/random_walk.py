"""The random-walk Kalman filter on the base velocity, for one robot or for many at once (paper, eq. rwkf and legodom).

A foot that stands still says how the base moves: minus the velocity of the sole relative to the base. The state is the
velocity in a world-fixed frame, a random walk; every planted foot measures it directly. All noise is isotropic, so the
covariance is one number per robot and both updates are a few elementwise operations.

Both feet are judged against the prediction and then fused together, not one after the other: left and right are
treated alike, and a mirrored measurement gives the mirrored estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.robots.model.spatial import skew
from golem.types import Array


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


def base_velocity(R: Array, omega: Array, soles: Array, rates: Array) -> Array:
    """Return the (..., 2, 3) velocity of base_link that each foot implies if it stands still [m/s], world axes.

        z_k = -R_b [omega_b x p_k + J_k dq]

    which is the paper's eq. (legodom) with omega in base_link, where p_k and J_k dq are known.

    Args:
        R: (..., 3, 3) rotation of base_link in the world-fixed frame.
        omega: (..., 3) angular rate of base_link, in base_link [rad/s].
        soles: (..., 2, 3) points of the left and the right foot, in base_link [m].
        rates: (..., 2, 3) their velocities relative to base_link, in base_link: J_k dq [m/s].
    """
    turning = soles @ skew(omega).swapaxes(-1, -2)
    return -(turning + rates) @ R.swapaxes(-1, -2)


def fuse(
    config: RandomWalkConfig, velocity: Array, variance: Array, measured: Array, weight: Array, dt: float
) -> tuple[Array, Array, Array]:
    """Predict by `dt` and fuse what the feet measure; leading axes are robots.

    Args:
        config: noise and gates.
        velocity: (..., 3) previous estimate [m/s].
        variance: (...) its variance per axis [m^2/s^2].
        measured: (..., 2, 3) the velocity that each foot implies, from `base_velocity` [m/s].
        weight: (..., 2) how far each foot is to be believed, 0 to 1, from `contact.Contact`.
        dt: time since the previous estimate [s].

    Returns:
        velocity (..., 3), variance (...), and information (..., 2): what each foot contributed [s^2/m^2], 0 for one
        that was left out.
    """
    prior = variance + config.walk**2 * dt
    innovation = measured - velocity[..., None, :]
    noise = config.foot_noise**2 / np.maximum(weight, config.min_weight)
    distance = (innovation * innovation).sum(axis=-1) / (prior[..., None] + noise)
    believed = (weight >= config.min_weight) & (distance <= config.reject)
    information = believed / (noise * np.maximum(distance / config.gate, 1.0))
    posterior = prior / (1.0 + prior * information.sum(axis=-1))
    step = (information[..., None] * innovation).sum(axis=-2)
    return velocity + posterior[..., None] * step, posterior, information


class RandomWalk:
    """`fuse` with its memory, for `shape` robots.

    Attributes:
        config: noise and gates.
        velocity: (*shape, 3) estimate [m/s].
        variance: (*shape,) its variance per axis [m^2/s^2].
        unmeasured: (*shape,) time since a foot was last believed [s].
    """

    def __init__(self, config: RandomWalkConfig, shape: tuple[int, ...] = ()) -> None:
        """Begin at rest."""
        self.config = config
        self.velocity: Array = np.zeros((*shape, 3))
        self.variance: Array = np.full(shape, config.start**2)
        self.unmeasured: Array = np.zeros(shape)

    def reset(self, where: NDArray[np.bool_] | None = None) -> None:
        """Put the robots `where` (*shape,) back to rest; None is all."""
        chosen = np.ones_like(self.variance, dtype=bool) if where is None else where
        self.velocity = np.where(chosen[..., None], 0.0, self.velocity)
        self.variance = np.where(chosen, self.config.start**2, self.variance)
        self.unmeasured = np.where(chosen, 0.0, self.unmeasured)

    def step(self, measured: Array, weight: Array, dt: float) -> Array:
        """Advance by `dt` [s] with `measured` (*shape, 2, 3) and `weight` (*shape, 2); return `velocity`."""
        self.velocity, self.variance, information = fuse(
            self.config, self.velocity, self.variance, measured, weight, dt
        )
        self.unmeasured = np.where(information.any(axis=-1), 0.0, self.unmeasured + dt)
        return self.velocity
