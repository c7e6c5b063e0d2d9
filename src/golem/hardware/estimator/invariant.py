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


class InvariantFilter:
    """The filter.

    Attributes:
        config: its noise.
        R: (3, 3) rotation of the IMU in odom.
        x: (4, 3) velocity of the IMU, its position, the left and the right contact point, in odom [m/s], [m].
        bias: (2, 3) of the gyro [rad/s] and the accelerometer [m/s^2], in the IMU's axes.
        P: (21, 21) covariance of the invariant error.
        planted: whether the left and the right contact point are in use.
    """

    def __init__(self, config: InvariantConfig) -> None:
        """Begin at the origin of odom."""
        self.config = config
        self.reset(np.eye(3), np.zeros(3))

    def reset(self, R: Array, p: Array) -> None:
        """Begin at rest, with the IMU's rotation `R` (3, 3) and position `p` (3,) [m] in odom, feet in the air."""
        c = self.config
        self.R: Array = R.copy()
        self.x: Array = np.zeros((4, 3))
        self.x[1] = p
        self.bias: Array = np.zeros((2, 3))
        spread = np.zeros(SIZE)
        spread[:_HEADING], spread[_V] = c.tilt, c.velocity
        spread[_GYRO], spread[_ACC] = c.gyro_bias, c.acc_bias
        # An invariant error of the rotation turns about the origin of odom, and moves what is away from it.
        self.P: Array = np.diag(spread**2)
        lever = np.eye(SIZE)
        lever[_P, _ROTATION] = skew(p)
        self.P = lever @ self.P @ lever.T
        self.planted: NDArray[np.bool_] = np.zeros(2, np.bool_)
        self._noise: Array = np.array([c.gyro_noise**2, c.acc_noise**2])
        self._wander: Array = np.zeros(SIZE)
        self._wander[_GYRO], self._wander[_ACC] = c.gyro_walk**2, c.acc_walk**2

    def predict(self, gyro: Array, acc: Array, weight: Array, dt: float) -> None:
        """Advance by one IMU sample.

        Args:
            gyro: (3,) measured angular rate [rad/s].
            acc: (3,) measured specific force [m/s^2].
            weight: (2,) how far each foot is to be believed to stand still.
            dt: time since the previous sample [s].
        """
        c = self.config
        contact = c.contact_noise**2 / np.maximum(weight, c.min_weight)
        invariant_kernel.predict(
            self.R, self.x, self.bias, self.P, self._noise, self._wander, contact, gyro, acc, dt
        )

    def update(
        self, points: Array, weight: Array, shift: Array, heading: float, hanging: bool
    ) -> NDArray[np.bool_]:
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
        c = self.config
        numbers = np.array(
            [c.min_weight, c.foot_noise**2, c.heading_noise**2, c.rest_noise**2, c.gate, c.reject]
        )
        return invariant_kernel.update(
            self.R,
            self.x,
            self.bias,
            self.P,
            self.planted,
            points,
            weight,
            shift,
            heading,
            hanging,
            numbers,
        )
