"""What the torso IMU says about base_link, which lies below the waist joint, and the other way round."""

from __future__ import annotations

import math

import numpy as np

from golem.kernels import njit
from golem.robots.model.table import JOINT_INDEX
from golem.types import Array, LowState

TORSO = JOINT_INDEX["torso_joint"]
"""Motor index of the waist: the only joint between base_link and the IMU, about their common z."""


@njit(cache=True, nogil=True)
def turn_to_base(gyro: Array, waist: float, waist_rate: float, out: Array) -> None:
    """Write into `out` (3,) the angular rate of base_link in base_link: Rz(waist) gyro - (0, 0, waist_rate) [rad/s].

    Args:
        gyro: (3,) angular rate of the torso in imu_link, whose axes are the torso's [rad/s].
        waist: position of `torso_joint` [rad].
        waist_rate: its velocity [rad/s].
        out: filled.
    """
    c, s = math.cos(waist), math.sin(waist)
    x, y, z = gyro[0], gyro[1], gyro[2]
    out[0], out[1], out[2] = c * x - s * y, s * x + c * y, z - waist_rate


def sensed_base_rate(state: LowState) -> Array:
    """Return the (3,) angular rate of base_link in base_link as `state` measures it [rad/s]."""
    rate = np.empty(3)
    turn_to_base(state.imu.gyro, float(state.q[TORSO]), float(state.dq[TORSO]), rate)
    return rate


@njit(cache=True, nogil=True, error_model="numpy")
def torso_motion(quat: Array, rate: Array, waist: float, waist_rate: float) -> tuple[Array, Array]:
    """Return the orientation (4,) wxyz of imu_link and its angular rate (3,) in imu_link [rad/s].

    Args:
        quat: (4,) orientation of base_link, wxyz.
        rate: (3,) its angular rate in base_link [rad/s].
        waist: position of `torso_joint` [rad].
        waist_rate: its velocity [rad/s].
    """
    w, x, y, z = quat[0], quat[1], quat[2], quat[3]
    c, s = math.cos(0.5 * waist), math.sin(0.5 * waist)
    turned, turning = np.empty(4), np.empty(3)
    turned[0], turned[1], turned[2], turned[3] = w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s
    c, s = math.cos(waist), math.sin(waist)
    a, b, yaw = rate[0], rate[1], rate[2]
    turning[0], turning[1], turning[2] = c * a + s * b, c * b - s * a, yaw + waist_rate
    return turned, turning
