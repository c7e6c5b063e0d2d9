"""Orientation of base_link from the torso's IMU, the waist joint between them undone, and the bias of its gyro."""

from __future__ import annotations

import math

import numpy as np

from golem.robots.model.imu_mount import TORSO
from golem.types import Array, LowState


class Attitude:
    """The orientation of base_link in odom, whose heading is zero at the reset."""

    def __init__(self) -> None:
        """Start without a heading."""
        self._heading = 0.0

    def reset(self, state: LowState) -> None:
        """Take the present heading of base_link as zero."""
        self._heading = 0.0
        R = self.rotation(state)
        self._heading = math.atan2(R[1, 0], R[0, 0])

    def rotation(self, state: LowState) -> Array:
        """Return the (3, 3) rotation of base_link in odom: the IMU's, less the torso joint's."""
        w, x, y, z = state.imu.quat.tolist()
        # q_z(-heading) q q_z(-torso): both turns are about z, so they mix w with z and x with y by their sum and
        # their difference.
        torso = float(state.q[TORSO])
        add, sub = 0.5 * (self._heading + torso), 0.5 * (self._heading - torso)
        c, s = math.cos(add), math.sin(add)
        w, z = c * w + s * z, c * z - s * w
        c, s = math.cos(sub), math.sin(sub)
        x, y = c * x + s * y, c * y - s * x
        k = 2.0 / (w * w + x * x + y * y + z * z)
        return np.array(
            [
                [1.0 - k * (y * y + z * z), k * (x * y - w * z), k * (x * z + w * y)],
                [k * (x * y + w * z), 1.0 - k * (x * x + z * z), k * (y * z - w * x)],
                [k * (x * z - w * y), k * (y * z + w * x), 1.0 - k * (x * x + y * y)],
            ]
        )


class GyroBias:
    """The bias of the gyro: how much faster it turns than the IMU's own orientation, which does not run away.

    Uncorrected, 0.1 deg/s under a base 0.95 m above its soles are 1.6 mm/s by which a standing robot seems to move.

    Attributes:
        value: (3,) estimate, axes of the IMU [rad/s].
    """

    MEMORY = 10.0
    """Time over which the difference is averaged, once so much has passed [s]."""
    START = 1.0
    """Time over which it is averaged at first [s]: the noise of one orientation counts over it."""

    def __init__(self) -> None:
        """Start without a bias."""
        self.reset()

    def reset(self) -> None:
        """Forget."""
        self.value: Array = np.zeros(3)
        self._before: list[float] | None = None
        self._elapsed = 0.0

    def step(self, state: LowState, dt: float) -> Array:
        """Take the sample `state`, `dt` [s] after the previous one, and return `value`."""
        w, x, y, z = state.imu.quat.tolist()
        if self._before is not None:
            # Vector part of q_before^-1 q: half the turn, in the IMU's axes.
            a, b, c, d = self._before
            turn = np.array(
                [a * x - b * w - c * z + d * y, a * y - c * w - d * x + b * z, a * z - d * w - b * y + c * x]
            )
            sign = 1.0 if a * w + b * x + c * y + d * z >= 0.0 else -1.0
            self._elapsed += dt
            share = dt / min(max(self._elapsed, self.START), self.MEMORY)
            self.value = self.value + share * (state.imu.gyro - (2.0 * sign / dt) * turn - self.value)
        self._before = [w, x, y, z]
        return self.value
