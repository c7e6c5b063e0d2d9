"""What an IMU reports, given the clean values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from golem.types import Array, Imu


@dataclass(frozen=True, slots=True)
class ImuBias:
    """The part of the IMU's error that stays what it is during one episode.

    Attributes:
        tilt: (4,) rotation of the world frame about a horizontal axis by which the attitude filter is wrong, wxyz.
        gyro: (3,) [rad/s], imu frame.
        acc: (3,) [m/s^2], imu frame.
    """

    tilt: Array
    gyro: Array
    acc: Array


@dataclass(frozen=True, slots=True)
class ImuErrors:
    """Magnitudes, each a standard deviation per axis.

    Attributes:
        gyro_noise, acc_noise: white noise of one sample [rad/s], [m/s^2].
        gyro_bias, acc_bias: constant over an episode [rad/s], [m/s^2].
        tilt: error of roll and pitch, constant over an episode [rad].
        attitude_noise: white noise of one orientation sample [rad].
    """

    gyro_noise: float = 0.0
    acc_noise: float = 0.0
    gyro_bias: float = 0.0
    acc_bias: float = 0.0
    tilt: float = 0.0
    attitude_noise: float = 0.0

    def draw_bias(self, rng: np.random.Generator) -> ImuBias:
        """Draw the constant errors of one episode."""
        tilt = self.tilt * np.append(rng.standard_normal(2), 0.0)
        return ImuBias(
            tilt=_small_rotation(tilt),
            gyro=self.gyro_bias * rng.standard_normal(3),
            acc=self.acc_bias * rng.standard_normal(3),
        )


class ImuModel:
    """Adds bias and white noise to clean samples, one call per sample."""

    def __init__(self, errors: ImuErrors, bias: ImuBias, rng: np.random.Generator) -> None:
        """Use the given magnitudes, episode bias and noise stream."""
        self._errors = errors
        self._bias = bias
        self._rng = rng

    def measure(self, quat: Array, gyro: Array, acc: Array) -> Imu:
        """Return the sample reported for the clean values.

        Args:
            quat: (4,) true orientation of imu_link in the world, wxyz, unit length.
            gyro: (3,) true angular rate [rad/s], imu frame.
            acc: (3,) true specific force [m/s^2], imu frame.
        """
        noise = self._rng.standard_normal((3, 3))
        return Imu(
            quat=_shaken(self._bias.tilt, quat, self._errors.attitude_noise * noise[0]),
            gyro=gyro + self._bias.gyro + self._errors.gyro_noise * noise[1],
            acc=acc + self._bias.acc + self._errors.acc_noise * noise[2],
        )


@njit(cache=True, nogil=True)
def _small_rotation(rotvec: Array) -> Array:
    """Return the unit quaternion of a rotation vector; exact to third order, for angles of a few degrees."""
    x, y, z = 0.5 * rotvec[0], 0.5 * rotvec[1], 0.5 * rotvec[2]
    scale = 1.0 / math.sqrt(1.0 + x * x + y * y + z * z)
    return np.array([scale, scale * x, scale * y, scale * z])


@njit(cache=True, nogil=True)
def _shaken(tilt: Array, quat: Array, rotvec: Array) -> Array:
    """Return the product of `tilt` (4,), `quat` (4,) and the small rotation `rotvec` (3,)."""
    return _multiply(tilt, _multiply(quat, _small_rotation(rotvec)))


@njit(cache=True, nogil=True)
def _multiply(p: Array, q: Array) -> Array:
    pw, px, py, pz = p[0], p[1], p[2], p[3]
    qw, qx, qy, qz = q[0], q[1], q[2], q[3]
    return np.array(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ]
    )
