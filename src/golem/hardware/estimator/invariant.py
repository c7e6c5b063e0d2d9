"""The right-invariant extended Kalman filter of a walking robot (Hartley et al., IJRR 2020), without its sensors.

State: the IMU's rotation R, velocity v and position p, the two contact points d (all in odom), and the biases of gyro
and accelerometer. The error is the invariant one, X_est = exp(xi) X, in the order

    xi = (rotation, v, p, d_left, d_right, gyro bias, accelerometer bias), 21 numbers, axes of odom,

so that prediction and kinematic measurement are linearised alike wherever the robot is and however it turns.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.robots.model.spatial import skew
from golem.types import Array

_GRAVITY = np.array([0.0, 0.0, -9.81])
_SIZE = 21
_ROTATION, _V, _P = slice(0, 3), slice(3, 6), slice(6, 9)
_CONTACTS = (slice(9, 12), slice(12, 15))
_BIAS, _GYRO, _ACC = slice(15, 21), slice(15, 18), slice(18, 21)
_HEADING = 2
"""Index of the error about the vertical."""
_EYE = np.eye(3)
_GRAVITY_SKEW = skew(_GRAVITY)


def _selection(plus: slice, minus: slice | None = None) -> Array:
    """Return the (n, 21) matrix that takes the part `plus` of the error, less the part `minus`."""
    eye = np.eye(_SIZE)
    return eye[plus] if minus is None else eye[plus] - eye[minus]


_SEE_HEADING = _selection(slice(_HEADING, _HEADING + 1))
_SEE_FEET = tuple(_selection(_P, where) for where in _CONTACTS)
_SEE_REST = _selection(_V)


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


def exp_and_jacobian(phi: Array) -> tuple[Array, Array]:
    """Return the rotation exp(phi) and the left Jacobian of SO(3) at `phi` (3,) [rad], (3, 3) each."""
    angle = math.sqrt(float(phi @ phi))
    if angle < 1e-6:
        a, b, c = 1.0, 0.5, 1.0 / 6.0
    else:
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle**2
        c = (1.0 - a) / angle**2
    K = skew(phi)
    KK = K @ K
    return _EYE + a * K + b * KK, _EYE + b * K + c * KK


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
        spread = np.zeros(_SIZE)
        spread[:_HEADING], spread[_V] = c.tilt, c.velocity
        spread[_GYRO], spread[_ACC] = c.gyro_bias, c.acc_bias
        # An invariant error of the rotation turns about the origin of odom, and moves what is away from it.
        self.P: Array = np.diag(spread**2)
        lever = np.eye(_SIZE)
        lever[_P, _ROTATION] = skew(p)
        self.P = lever @ self.P @ lever.T
        self.planted = [False, False]
        self._transition: Array = np.eye(_SIZE)
        self._noise: Array = np.repeat([c.gyro_noise**2, c.acc_noise**2], 3)
        self._wander: Array = np.zeros(_SIZE)
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
        R, x = self.R, self.x
        # How errors of gyro (first three columns) and accelerometer enter the invariant error.
        enter = np.zeros((15, 6))
        enter[_ROTATION, :3] = R
        enter[3:, :3] = (skew(x) @ R).reshape(12, 3)
        enter[_V, 3:] = R
        F = self._transition
        F[_V, _ROTATION] = _GRAVITY_SKEW * dt
        F[_P, _V] = _EYE * dt
        F[:15, _BIAS] = enter * -dt
        P = F @ self.P @ F.T
        P[:15, :15] += (enter * (self._noise * dt)) @ enter.T
        left, right = np.maximum(weight, c.min_weight).tolist()
        self._wander[_CONTACTS[0]], self._wander[_CONTACTS[1]] = (
            c.contact_noise**2 / left,
            c.contact_noise**2 / right,
        )
        P.ravel()[:: _SIZE + 1] += self._wander * dt
        self.P = P

        a = R @ (acc - self.bias[1]) + _GRAVITY
        x[1] += x[0] * dt + 0.5 * dt * dt * a
        x[0] += a * dt
        self.R = R @ exp_and_jacobian((gyro - self.bias[0]) * dt)[0]

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
        P = self.P
        seen = points @ self.R.T
        self.x[2:] += shift @ self.R.T
        # The heading, then the feet that are believed, then the velocity at rest: rows, innovations and variances.
        rows, nus, noises = [_SEE_HEADING], [[heading]], [c.heading_noise**2]
        believed = np.zeros(2, dtype=bool)
        for k, H in enumerate(_SEE_FEET):
            if weight[k] < c.min_weight:
                self.planted[k] = False
                continue
            nu = seen[k] - self.x[2 + k] + self.x[1]
            S = H @ P @ H.T + c.foot_noise**2 * _EYE
            distance = float(nu @ np.linalg.inv(S) @ nu)
            if not self.planted[k] or distance > c.reject:
                self._plant(k, seen[k])
                continue
            believed[k] = True
            rows.append(H)
            nus.append(nu.tolist())
            noises += [c.foot_noise**2 * max(distance / c.gate, 1.0)] * 3
        if hanging:
            rows.append(_SEE_REST)
            nus.append(self.x[0].tolist())
            noises += [c.rest_noise**2] * 3
        H = np.concatenate(rows)
        PH = P @ H.T
        S = H @ PH
        S.ravel()[:: len(S) + 1] += noises
        K = np.linalg.solve(S, PH.T).T
        correction = K @ np.array([n for nu in nus for n in nu])
        self._correct(np.asarray(-correction, dtype=np.float64))
        P = P - K @ PH.T
        self.P = 0.5 * (P + P.T)
        return believed

    def _plant(self, k: int, seen: Array) -> None:
        """Put contact point `k` where it is seen, `seen` (3,) from the IMU, axes of odom [m]."""
        self.planted[k] = True
        self.x[2 + k] = self.x[1] + seen
        where = _CONTACTS[k]
        P = self.P
        P[where], P[:, where] = P[_P], P[:, _P]
        P[where, where] = P[_P, _P] + self.config.foot_noise**2 * _EYE

    def _correct(self, delta: Array) -> None:
        """Apply the invariant correction `delta` (21,)."""
        turn, jacobian = exp_and_jacobian(delta[_ROTATION])
        self.R = turn @ self.R
        self.x = self.x @ turn.T + delta[3:15].reshape(4, 3) @ jacobian.T
        self.bias = self.bias + delta[_BIAS].reshape(2, 3)
