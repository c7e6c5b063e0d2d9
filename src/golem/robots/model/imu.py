"""What the torso IMU says about base_link, which lies below the waist joint."""

from __future__ import annotations

import numpy as np

from golem.types import Array


def base_rate(gyro: Array, waist: Array, waist_rate: Array) -> Array:
    """Return the (..., 3) angular rate of base_link in base_link: Rz(waist) gyro - (0, 0, waist_rate) [rad/s].

    Args:
        gyro: (..., 3) angular rate of the torso in imu_link, whose axes are the torso's [rad/s].
        waist: (...) position of `torso_joint` [rad].
        waist_rate: (...) its velocity [rad/s].
    """
    c, s = np.cos(waist), np.sin(waist)
    x, y, z = gyro[..., 0], gyro[..., 1], gyro[..., 2]
    return np.stack([c * x - s * y, s * x + c * y, z - waist_rate], axis=-1)
