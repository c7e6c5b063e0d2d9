"""Torque that holds every joint against gravity, for a robot whose base may hang or stand at any inclination."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin

from golem.robots.model.imu_mount import TORSO
from golem.robots.model.pinocchio_model import build
from golem.types import GRAVITY, Array


class Gravity:
    """Generalised gravity of the model with fixed base, in a gravity field turned by the IMU.

    Equal to the lower 27 rows of the free-flyer's gravity vector, for less work. The IMU sits on the torso, above
    the waist joint, whose rotation about z is undone to obtain the field in base_link.
    """

    def __init__(self, hands: bool = True) -> None:
        """Build the model, with or without the MAGPIE hands."""
        self._model = build(hands=hands, free_base=False)
        self._data = self._model.createData()
        self._field = np.zeros(3)

    def torque(self, q: Array, quat: Array) -> Array:
        """Return the (27,) torque [N m] that balances gravity; valid until the next call.

        Args:
            q: (27,) joint positions [rad].
            quat: (4,) orientation of the torso IMU, wxyz.
        """
        w, x, y, z = quat.tolist()
        scale = GRAVITY / (w * w + x * x + y * y + z * z)
        # Down in the torso: minus the third row of its rotation matrix.
        down_x = -2.0 * (x * z - w * y) * scale
        down_y = -2.0 * (y * z + w * x) * scale
        yaw = float(q[TORSO])
        c, s = math.cos(yaw), math.sin(yaw)
        field = self._field
        field[0] = c * down_x - s * down_y
        field[1] = s * down_x + c * down_y
        field[2] = -(w * w - x * x - y * y + z * z) * scale
        self._model.gravity.linear = field
        return pin.computeGeneralizedGravity(self._model, self._data, q)
