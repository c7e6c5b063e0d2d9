"""What an IMU reports, given the clean values."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from golem.kernels import njit
from golem.native import Record, Records, address, new_record, view
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
        gyro, acc = self.gyro_bias * rng.standard_normal(3), self.acc_bias * rng.standard_normal(3)
        return ImuBias(tilt=_small_rotation(tilt), gyro=gyro, acc=acc)


BLOCK = 256
"""Samples whose noise is drawn at once; drawn one by one it would be the same."""

IMU = np.dtype(
    [("tilt", "f8", 4), ("bias", "f8", (2, 3)), ("noise", "f8", 3), ("used", "i8"), ("drawn", "f8", (BLOCK, 3, 3))]
)
"""Errors of an IMU: tilt; bias of gyro and accelerometer; magnitudes of the noise of orientation, gyro and
accelerometer; standard normal numbers for them, and how many samples have used theirs."""


@njit(cache=True, nogil=True)
def measure_imu(m: Record, quat: Array, gyro: Array, acc: Array, out: Record) -> None:
    """Write the sample reported for clean values into `quat`, `gyro` and `acc` of `out`; see `ImuModel.measure`.

    `m` is an `IMU` with noise left.
    """
    drawn = m.drawn[m.used]
    m.used += 1
    rotvec = np.empty(3)
    for i in range(3):
        rotvec[i] = m.noise[0] * drawn[0, i]
        out.gyro[i] = gyro[i] + m.bias[0, i] + m.noise[1] * drawn[1, i]
        out.acc[i] = acc[i] + m.bias[1, i] + m.noise[2] * drawn[2, i]
    shaken = _shaken(m.tilt, quat, rotvec)
    for i in range(4):
        out.quat[i] = shaken[i]


_SAMPLE = np.dtype([("quat", "f8", (4,)), ("gyro", "f8", (3,)), ("acc", "f8", (3,))])
_imu_at, _sample_at = view(IMU), view(_SAMPLE)


@njit(cache=True, nogil=True)
def _measure(imu: int, quat: Array, gyro: Array, acc: Array, sample: int) -> None:
    """Do what `measure_imu` does on what stands at two addresses: Python takes 20 us to hand a record over."""
    measure_imu(_imu_at(imu), quat, gyro, acc, _sample_at(sample))


class ImuModel:
    """Adds bias and white noise to clean samples, one call per sample; `memory` is an `IMU`."""

    def __init__(
        self, errors: ImuErrors, bias: ImuBias, rng: np.random.Generator, memory: Records | None = None
    ) -> None:
        """Use the given magnitudes, episode bias and noise stream; `memory`, an `IMU`, None for one of its own."""
        self.memory = memory = new_record(IMU) if memory is None else memory
        memory["tilt"], memory["bias"] = bias.tilt, (bias.gyro, bias.acc)
        memory["noise"] = errors.attitude_noise, errors.gyro_noise, errors.acc_noise
        memory["used"] = BLOCK
        self._rng = rng
        self._sample = new_record(_SAMPLE)
        self._places = address(memory), address(self._sample)

    def measure(self, quat: Array, gyro: Array, acc: Array) -> Imu:
        """Return the sample reported for the clean values.

        Args:
            quat: (4,) true orientation of imu_link in the world, wxyz, unit length.
            gyro: (3,) true angular rate [rad/s], imu frame.
            acc: (3,) true specific force [m/s^2], imu frame.
        """
        if self.memory["used"][0] >= BLOCK:
            self.memory["drawn"], self.memory["used"] = self._rng.standard_normal((BLOCK, 3, 3)), 0
        _measure(self._places[0], quat, gyro, np.ascontiguousarray(acc), self._places[1])
        sample = self._sample.copy()[0]
        return Imu(sample["quat"], sample["gyro"], sample["acc"])


@njit(cache=True, nogil=True, error_model="numpy")
def _small_rotation(rotvec: Array) -> Array:
    """Return the unit quaternion of a rotation vector; exact to third order, for angles of a few degrees."""
    x, y, z = 0.5 * rotvec[0], 0.5 * rotvec[1], 0.5 * rotvec[2]
    scale = 1.0 / math.sqrt(1.0 + x * x + y * y + z * z)
    out = np.empty(4)
    out[0], out[1], out[2], out[3] = scale, scale * x, scale * y, scale * z
    return out


@njit(cache=True, nogil=True, error_model="numpy")
def _shaken(tilt: Array, quat: Array, rotvec: Array) -> Array:
    """Return the product of `tilt` (4,), `quat` (4,) and the small rotation `rotvec` (3,)."""
    return _multiply(tilt, _multiply(quat, _small_rotation(rotvec)))


@njit(cache=True, nogil=True, error_model="numpy")
def _multiply(p: Array, q: Array) -> Array:
    pw, px, py, pz = p[0], p[1], p[2], p[3]
    qw, qx, qy, qz = q[0], q[1], q[2], q[3]
    out = np.empty(4)
    out[0] = pw * qw - px * qx - py * qy - pz * qz
    out[1] = pw * qx + px * qw + py * qz - pz * qy
    out[2] = pw * qy - px * qz + py * qw + pz * qx
    out[3] = pw * qz + px * qy - py * qx + pz * qw
    return out
