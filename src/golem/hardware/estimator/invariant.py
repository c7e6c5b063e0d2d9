"""The right-invariant extended Kalman filter of a walking robot (Hartley et al., IJRR 2020), without its sensors.

State: the IMU's rotation R, velocity v and position p, the two contact points d (all in odom), and the biases of gyro
and accelerometer. The error is the invariant one, X_est = exp(xi) X, in the order

    xi = (rotation, v, p, d_left, d_right, gyro bias, accelerometer bias), 21 numbers, axes of odom,

so that prediction and kinematic measurement are linearised alike wherever the robot is and however it turns.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.hardware.estimator import invariant_kernel
from golem.hardware.estimator.invariant_kernel import SIZE
from golem.kernels import njit
from golem.native import Record, Records, new_record
from golem.robots.model.spatial import skew
from golem.types import Array

_ROTATION, _V, _P = slice(0, 3), slice(3, 6), slice(6, 9)
_GYRO, _ACC = slice(15, 18), slice(18, 21)
_HEADING = 2
"""Index of the error about the vertical."""


@dataclass(frozen=True, slots=True)
class InvariantConfig:
    """Noise, gates and initial uncertainty; densities unless said otherwise.

    Attributes:
        gyro_noise, acc_noise: white noise [rad/sqrt(s)], [m/s/sqrt(s)]. The twin's IMU has 1.7e-4 and 1.3e-3
            (0.0039 rad/s and 0.028 m/s^2 per sample at 500 Hz); the rest is for what a stiff model leaves out.
        gyro_walk, acc_walk: how the biases wander [rad/s/sqrt(s)], [m/s^2/sqrt(s)].
        contact_noise: how a fully loaded foot wanders [m/sqrt(s)]; a foot of weight w does by 1/sqrt(w) of that.
        foot_noise: standard deviation of a foot's position relative to the IMU, per sample [m]: the encoders' noise
            over the length of the leg.
        heading_noise: the same of the IMU's own heading [rad]. Feet and accelerometer say nothing about heading,
            whose error would grow with the bias of the gyro.
        rest_noise: the same of the velocity of a robot whose feet have not carried it yet: it hangs [m/s].
        min_weight: a foot of less weight is in the air.
        gate: squared Mahalanobis distance up to which a foot is believed as it is (chi-square, 3 degrees, 99 %).
        reject: squared distance beyond which a foot has slipped: it is put where it is now seen.
        tilt, velocity, gyro_bias, acc_bias: standard deviations at the reset [rad], [m/s], [rad/s], [m/s^2].
    """

    gyro_noise: float = 1e-3
    acc_noise: float = 1e-2
    gyro_walk: float = 1e-5
    acc_walk: float = 1e-3
    contact_noise: float = 3e-3
    foot_noise: float = 3e-3
    heading_noise: float = 0.02
    rest_noise: float = 0.3
    min_weight: float = 0.05
    gate: float = 11.34
    reject: float = 113.4
    tilt: float = 0.01
    velocity: float = 0.1
    gyro_bias: float = 0.005
    acc_bias: float = 0.1


INVARIANT = np.dtype(
    [
        ("R", "f8", (3, 3)),
        ("x", "f8", (4, 3)),
        ("bias", "f8", (2, 3)),
        ("P", "f8", (SIZE, SIZE)),
        ("planted", "i8", (2,)),
        ("noise", "f8", (2,)),
        ("wander", "f8", (SIZE,)),
        ("contact_noise", "f8"),
        ("numbers", "f8", (6,)),
    ]
)
"""State and options of the filter; see `InvariantFilter`."""


@njit(cache=True, nogil=True)
def predict(m: Record, gyro: Array, acc: Array, weight: Array, dt: float) -> None:
    """Advance the `INVARIANT` `m` by one IMU sample; see `InvariantFilter.predict`."""
    contact = np.empty(2)
    for k in range(2):
        contact[k] = m.contact_noise / max(weight[k], m.numbers[0])
    invariant_kernel.predict(m.R, m.x, m.bias, m.P, m.noise, m.wander, contact, gyro, acc, dt)


@njit(cache=True, nogil=True)
def update(m: Record, points: Array, weight: Array, shift: Array, heading: float, hanging: bool) -> NDArray[np.bool_]:
    """Fuse where the feet are seen into the `INVARIANT` `m`; see `InvariantFilter.update`."""
    return invariant_kernel.update(m.R, m.x, m.bias, m.P, m.planted, points, weight, shift, heading, hanging, m.numbers)


class InvariantFilter:
    """The filter.

    Attributes:
        config: its noise.
        memory: all it knows; the next five are views of it.
        R: (3, 3) rotation of the IMU in odom.
        x: (4, 3) velocity of the IMU, its position, the left and the right contact point, in odom [m/s], [m].
        bias: (2, 3) of the gyro [rad/s] and the accelerometer [m/s^2], in the IMU's axes.
        P: (21, 21) covariance of the invariant error.
        planted: (2,) whether the left and the right contact point are in use, 0 or 1.
    """

    def __init__(self, config: InvariantConfig, memory: Records | None = None) -> None:
        """Begin at the origin of odom, in `memory`, an `INVARIANT`, or in one of its own."""
        self.config = config
        self.memory = memory = new_record(INVARIANT) if memory is None else memory
        c = config
        memory["noise"] = c.gyro_noise**2, c.acc_noise**2
        memory["wander"][0, _GYRO], memory["wander"][0, _ACC] = c.gyro_walk**2, c.acc_walk**2
        memory["contact_noise"] = c.contact_noise**2
        memory["numbers"] = (
            c.min_weight, c.foot_noise**2, c.heading_noise**2, c.rest_noise**2, c.gate, c.reject
        )  # fmt: skip
        self.R: Array = memory["R"][0]
        self.x: Array = memory["x"][0]
        self.bias: Array = memory["bias"][0]
        self.P: Array = memory["P"][0]
        self.planted: NDArray[np.int64] = memory["planted"][0]
        self.reset(np.eye(3), np.zeros(3))

    def reset(self, R: Array, p: Array) -> None:
        """Begin at rest, with the IMU's rotation `R` (3, 3) and position `p` (3,) [m] in odom, feet in the air."""
        c = self.config
        self.R[:], self.x[:], self.bias[:], self.planted[:] = R, 0.0, 0.0, 0
        self.x[1] = p
        spread = np.zeros(SIZE)
        spread[:_HEADING], spread[_V] = c.tilt, c.velocity
        spread[_GYRO], spread[_ACC] = c.gyro_bias, c.acc_bias
        # An invariant error of the rotation turns about the origin of odom, and moves what is away from it.
        lever = np.eye(SIZE)
        lever[_P, _ROTATION] = skew(p)
        self.P[:] = lever @ np.diag(spread**2) @ lever.T

    def predict(self, gyro: Array, acc: Array, weight: Array, dt: float) -> None:
        """Advance by one IMU sample.

        Args:
            gyro: (3,) measured angular rate [rad/s].
            acc: (3,) measured specific force [m/s^2].
            weight: (2,) how far each foot is to be believed to stand still.
            dt: time since the previous sample [s].
        """
        predict(self.memory[0], gyro, acc, weight, dt)

    def update(self, points: Array, weight: Array, shift: Array, heading: float, hanging: bool) -> NDArray[np.bool_]:
        """Fuse where the feet are seen, and the heading.

        Args:
            points: (2, 3) contact points, in the IMU's frame [m].
            weight: (2,) how far each foot is to be believed to stand still.
            shift: (2, 3) by how much the contact points have moved within the soles since the last call, axes of the
                IMU [m].
            heading: by how much the estimated heading exceeds the IMU's own [rad].
            hanging: whether to take the robot as being at rest.

        Returns:
            (2,) which feet were believed.
        """
        return update(self.memory[0], points, weight, shift, heading, hanging)
