"""The error-state filter of an inertial odometry: motion by the IMU, corrected by planes and by the legs.

The state is rotation R, place p, velocity v of the IMU in the level frame, biases of gyro and accelerometer, the
horizontal part of gravity in that frame, which says how far from level the start was, and the angle by which the sensor
is turned about the base's vertical beside the model: by its mount and by the zero of the waist's encoder.

The error of R is on its right:
R_true = R Exp(theta). Equations after Sola, Quaternion kinematics for the error-state Kalman filter (2017), and the
iterated update of Xu and Zhang, FAST-LIO (RA-L 2021), in information form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from golem.kernels import njit
from golem.types import GRAVITY, Array

SIZE = 18
"""Numbers of the error: theta, p, v, gyro bias, accelerometer bias, gravity x and y, yaw of the sensor."""
GRAVITY_XY, YAW = slice(15, 17), 17
"""Which of them are of gravity, and that yaw."""


@dataclass(frozen=True, slots=True)
class ImuNoise:
    """What the filter takes the IMU to be.

    Attributes:
        gyro, acc: white noise of one sample [rad/s], [m/s^2].
        gyro_walk, acc_walk: drift of the biases [rad/s/sqrt(s)], [m/s^2/sqrt(s)].
        gyro_bias: standard deviation of the gyro's bias from the mean of the start, during which a robot that balances
            turns a little [rad/s].
        acc_bias: the same of the accelerometer's bias from zero [m/s^2].
        yaw: the same of the angle by which the sensor is turned about the vertical of base_link [rad].
    """

    gyro: float = 0.003
    acc: float = 0.05
    gyro_walk: float = 0.0001
    acc_walk: float = 0.001
    gyro_bias: float = 0.004
    acc_bias: float = 0.06
    yaw: float = 0.035


@dataclass(frozen=True, slots=True)
class Beginning:
    """Where an inertial odometry begins, and how well that is known.

    Attributes:
        R: (3, 3) rotation of the IMU's axes in a level frame in which base_link heads along x.
        p: (3,) place of the IMU in it; base_link is at the origin [m].
        gyro_bias: (3,) [rad/s].
        force: mean specific force, of a robot at rest that of gravity [m/s^2].
        velocity: (3,) of the IMU [m/s].
        speed, tilt, bias: standard deviations per axis of the velocity [m/s], of gravity's x and y [m/s^2], and of the
            gyro's bias [rad/s]; None: that of the filter.
    """

    R: Array
    p: Array
    gyro_bias: Array
    force: float = GRAVITY
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    speed: float = 0.01
    tilt: float | None = None
    bias: float | None = None


class ErrorState:
    """State and covariance at one time.

    Attributes:
        t: time [s].
        R: (3, 3) rotation of the IMU's axes in the level frame.
        x: (15,) p, v, gyro bias, accelerometer bias, gravity x and y, yaw of the sensor.
        P: (18, 18) covariance of the error.
    """

    def __init__(self, t: float, begin: Beginning, yaw: float, noise: ImuNoise) -> None:
        """Start at time `t` [s] as `begin` says, with the sensor at a heading of `yaw` [rad]."""
        self.t, self.R, self.noise = t, begin.R.copy(), noise
        self.x: Array = np.concatenate([begin.p, begin.velocity, begin.gyro_bias, np.zeros(5), [yaw]])
        tilt, bias = begin.tilt or noise.acc_bias, begin.bias or noise.gyro_bias
        deviations = np.repeat([1e-4, 1e-4, begin.speed, bias, noise.acc_bias, tilt, noise.yaw], (3, 3, 3, 3, 3, 2, 1))
        # The start's frame has no error; how far it is from level is gravity's error.
        self.P: Array = np.diag(deviations**2)
        self.last_gyro: Array = begin.gyro_bias.copy()

    def copy(self) -> ErrorState:
        """Return one that can go its own way."""
        out = object.__new__(ErrorState)
        out.t, out.noise, out.last_gyro = self.t, self.noise, self.last_gyro
        out.R, out.x, out.P = self.R.copy(), self.x.copy(), self.P.copy()
        return out

    @property
    def p(self) -> Array:
        """(3,) place of the IMU [m]."""
        return self.x[:3]

    @property
    def v(self) -> Array:
        """(3,) its velocity [m/s]."""
        return self.x[3:6]

    def predict(self, t: float, gyro: Array, acc: Array) -> None:
        """Advance to time `t` [s] with the mean `gyro` [rad/s] and `acc` [m/s^2] (3,) since then."""
        n = self.noise
        _predict(self.R, self.x, self.P, gyro, acc, t - self.t, np.array([n.gyro, n.acc, n.gyro_walk, n.acc_walk]))
        self.t, self.last_gyro = t, gyro

    def rate(self) -> Array:
        """Return the (3,) angular rate in the IMU's axes, bias removed [rad/s]."""
        return self.last_gyro - self.x[6:9]

    @property
    def yaw(self) -> float:
        """The angle by which the sensor is turned about the base's vertical beside the model [rad]."""
        return float(self.x[14])

    def level(self) -> Array:
        """Return the (3, 3) rotation from the start's frame to a level one, by what is known of gravity."""
        return exp(self.level_error() @ self.x[12:14])

    @staticmethod
    def level_error() -> Array:
        """Return the (3, 2) derivative of that rotation's vector by gravity's x and y [rad s^2/m]."""
        return np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 0.0]]) / GRAVITY

    def update_velocity(self, measured: Array, R_base_imu: Array, arm: Array, deviation: float) -> bool:
        """Take in a velocity of the base; return whether it was believed: not where it is off by over 5 deviations.

        Args:
            measured: (3,) velocity of a point of the base, in the base's axes [m/s].
            R_base_imu: (3, 3) nominal rotation of the IMU's axes in the base's.
            arm: (3,) that point in the IMU's frame [m].
            deviation: standard deviation per axis [m/s].
        """
        own, M = self.R.T @ self.v, about_z(self.yaw) @ R_base_imu
        told = M @ (own + cross(self.rate(), arm))
        H = np.zeros((3, SIZE))
        H[:, :3] = M @ _skew(own)
        H[:, 6:9] = M @ self.R.T
        H[:, 9:12] = M @ _skew(arm)
        H[:, YAW] = -told[1], told[0], 0.0
        y = measured - told
        S = H @ self.P @ H.T + deviation**2 * np.eye(3)
        if y @ np.linalg.solve(S, y) > 25.0:
            return False
        K = np.linalg.solve(S, H @ self.P).T
        rest = np.eye(SIZE) - K @ H
        self.P = rest @ self.P @ rest.T + deviation**2 * K @ K.T
        self.add(K @ y)
        return True

    def add(self, error: Array) -> None:
        """Correct the state by an error (18,)."""
        self.R = self.R @ exp(error[:3])
        self.x = self.x + error[3:]

    def minus(self, other: ErrorState) -> Array:
        """Return the error (18,) that takes `other` to this; their rotations are near each other."""
        turn = other.R.T @ self.R
        theta = 0.5 * np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        return np.concatenate([theta, self.x - other.x])


def about_z(angle: float) -> Array:
    """Return the (3, 3) rotation about z by `angle` [rad]."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


@njit(cache=True, nogil=True, error_model="numpy")
def _series(square: float) -> tuple[float, float]:
    """Return sin(a) / a and (1 - cos(a)) / a^2 of the angle whose square is given [rad^2]."""
    if square < 1e-8:
        return 1.0 - square / 6.0, 0.5 - square / 24.0
    angle = math.sqrt(square)
    return math.sin(angle) / angle, (1.0 - math.cos(angle)) / square


@njit(cache=True, nogil=True, error_model="numpy")
def exp(v: Array) -> Array:
    """Return the (3, 3) rotation of a rotation vector (3,) [rad]."""
    s, c = _series(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    x, y, z = v[0], v[1], v[2]
    out = np.empty((3, 3))
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - c * (y * y + z * z), c * x * y - s * z, c * x * z + s * y
    out[1, 0], out[1, 1], out[1, 2] = c * x * y + s * z, 1.0 - c * (x * x + z * z), c * y * z - s * x
    out[2, 0], out[2, 1], out[2, 2] = c * x * z - s * y, c * y * z + s * x, 1.0 - c * (x * x + y * y)
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _skew(v: Array) -> Array:
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2], out[1, 2] = -v[2], v[1], -v[0]
    out[1, 0], out[2, 0], out[2, 1] = v[2], -v[1], v[0]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def cross(a: Array, b: Array) -> Array:
    """Return a x b (3,): NumPy's takes twenty times as long."""
    out = np.empty(3)
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        out[i] = a[j] * b[k] - a[k] * b[j]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _predict(R: Array, x: Array, P: Array, gyro: Array, acc: Array, dt: float, noise: Array) -> None:
    omega, force, half = np.empty(3), np.empty(3), np.empty(3)
    for i in range(3):
        omega[i] = dt * (gyro[i] - x[6 + i])
        half[i] = 0.5 * omega[i]
        force[i] = acc[i] - x[9 + i]
    middle, turn, a = _product(R, exp(half)), exp(omega), np.empty(3)
    vertical = math.sqrt(GRAVITY * GRAVITY - x[12] * x[12] - x[13] * x[13])
    F = np.zeros((SIZE, SIZE))
    for i in range(SIZE):
        F[i, i] = 1.0
    tilt = _product(middle, _skew(force))
    for i in range(3):
        a[i] = middle[i, 0] * force[0] + middle[i, 1] * force[1] + middle[i, 2] * force[2]
        for j in range(3):
            F[i, j] = turn[j, i]
            F[6 + i, j] = -dt * tilt[i, j]
            F[3 + i, j] = -0.5 * dt * dt * tilt[i, j]
            F[6 + i, 12 + j] = -dt * middle[i, j]
            F[3 + i, 12 + j] = -0.5 * dt * dt * middle[i, j]
        F[i, 9 + i] = -dt
        F[3 + i, 6 + i] = dt
    a[0] += x[12]
    a[1] += x[13]
    a[2] -= vertical
    for i in range(2):
        F[6 + i, 15 + i] = dt
        F[3 + i, 15 + i] = 0.5 * dt * dt
        F[8, 15 + i] = dt * x[12 + i] / vertical
        F[5, 15 + i] = 0.5 * dt * dt * x[12 + i] / vertical
    half_way = _product(F, P)
    for i in range(SIZE):
        for j in range(SIZE):
            P[i, j] = 0.0
            for k in range(SIZE):
                P[i, j] += half_way[i, k] * F[j, k]
    turned = _product(R, turn)
    for i in range(3):
        P[i, i] += (noise[0] * dt) ** 2
        P[6 + i, 6 + i] += (noise[1] * dt) ** 2
        P[9 + i, 9 + i] += noise[2] * noise[2] * dt
        P[12 + i, 12 + i] += noise[3] * noise[3] * dt
        x[i] += dt * x[3 + i] + 0.5 * dt * dt * a[i]
        x[3 + i] += dt * a[i]
        for j in range(3):
            R[i, j] = turned[i, j]


@njit(cache=True, nogil=True, error_model="numpy")
def _product(A: Array, B: Array) -> Array:
    """Return the product of two (n, n) matrices, the first mostly zeros."""
    n = len(A)
    out = np.zeros((n, n))
    for i in range(n):
        for k in range(n):
            if A[i, k] != 0.0:
                for j in range(n):
                    out[i, j] += A[i, k] * B[k, j]
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def deskew(points: Array, times: Array, t: Array, R: Array, p: Array, v: Array, omega: Array, arm: Array) -> Array:
    """Return points in the frame of the IMU at the last time.

    Args:
        points: (n, 3) in the LiDAR's frame, each at its own time.
        times: (n,) ascending [s].
        t: (m,) times at which the motion of the IMU is known [s].
        R: (m, 3, 3) its rotations.
        p: (m, 3) its places [m].
        v: (m, 3) its velocities [m/s].
        omega: (m, 3) its angular rate from each time to the next, in its axes [rad/s].
        arm: (3,) the LiDAR's origin in the IMU's frame [m].
    """
    out = np.empty((len(points), 3))
    last = len(t) - 1
    E, ex, ey, ez = R[last], p[last, 0], p[last, 1], p[last, 2]
    k = 0
    for i in range(len(points)):
        while k < last - 1 and times[i] > t[k + 1]:
            k += 1
        dt = t[k + 1] - t[k]
        share = (times[i] - t[k]) / dt
        angle = share * dt
        u, w = angle * omega[k, 0], angle * omega[k, 1]
        z = angle * omega[k, 2]
        s, c = _series(u * u + w * w + z * z)
        a0, a1, a2 = points[i, 0] + arm[0], points[i, 1] + arm[1], points[i, 2] + arm[2]
        # Rodrigues' formula: a + s v x a + c v x (v x a).
        b0, b1, b2 = w * a2 - z * a1, z * a0 - u * a2, u * a1 - w * a0
        a0 += s * b0 + c * (w * b2 - z * b1)
        a1 += s * b1 + c * (z * b0 - u * b2)
        a2 += s * b2 + c * (u * b1 - w * b0)
        # A cubic would do no better: between two samples the velocity is straight.
        h = 0.5 * share
        Q = R[k]
        q0 = Q[0, 0] * a0 + Q[0, 1] * a1 + Q[0, 2] * a2 + p[k, 0] - ex
        q1 = Q[1, 0] * a0 + Q[1, 1] * a1 + Q[1, 2] * a2 + p[k, 1] - ey
        q2 = Q[2, 0] * a0 + Q[2, 1] * a1 + Q[2, 2] * a2 + p[k, 2] - ez
        q0 += angle * (v[k, 0] + h * (v[k + 1, 0] - v[k, 0]))
        q1 += angle * (v[k, 1] + h * (v[k + 1, 1] - v[k, 1]))
        q2 += angle * (v[k, 2] + h * (v[k + 1, 2] - v[k, 2]))
        out[i, 0] = E[0, 0] * q0 + E[1, 0] * q1 + E[2, 0] * q2
        out[i, 1] = E[0, 1] * q0 + E[1, 1] * q1 + E[2, 1] * q2
        out[i, 2] = E[0, 2] * q0 + E[1, 2] * q1 + E[2, 2] * q2
    return out
