"""A twin with what may be wrong with a robot that is brought up for the first time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from golem.errors import unknown_name
from golem.robots.model.table import JOINT_INDEX
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.types import Array, Imu

FAULTS: dict[str, str] = {
    "none": "",
    "swapped_joints": "joints",
    "wrong_sign": "joints",
    "silent_estop": "estop",
    "missing_camera": "sensors",
    "tilted_imu": "state",
}
"""What can be wrong, and the check that has to find it."""
SWAPPED = JOINT_INDEX["left_hip_pitch_joint"], JOINT_INDEX["right_hip_pitch_joint"]
"""Two encoders whose plugs are in each other's place."""
FLIPPED = JOINT_INDEX["left_hip_roll_joint"]
"""One that counts the other way."""
TILT = 0.4
"""How far the IMU is turned in its mount [rad]."""


@dataclass(frozen=True)
class MiswiredTwinConfig(MujocoConfig):
    """Options of the twin.

    Attributes:
        fault: what is wrong with it, a key of `FAULTS`.
    """

    fault: str = "none"

    def __post_init__(self) -> None:
        """BringupStep the options."""
        super().__post_init__()
        if self.fault not in FAULTS:
            raise unknown_name("fault of a bring-up", self.fault, FAULTS)


class MiswiredTwin(MujocoRobot):
    """The twin, with a fault in what it reports; see `golem.robots.base.Robot`."""

    def __init__(self, profile: str, seed: int, posture: Array, config: MiswiredTwinConfig | None = None) -> None:
        """Build it; see `MujocoRobot`."""
        wrong = config or MiswiredTwinConfig()
        super().__init__(profile, seed, posture, wrong)
        self._fault = wrong.fault
        if self._fault == "missing_camera":
            self.cameras = {name: info for name, info in self.cameras.items() if name != "head"}
            self.calibration = {name: T for name, T in self.calibration.items() if name != "head"}

    def joints(self) -> tuple[Array, Array, Array]:
        """Return q, dq, tau as they are reported; see `Robot`."""
        q, dq, tau = super().joints()
        return reported(self._fault, q), reported(self._fault, dq), reported(self._fault, tau)

    def imu(self) -> Imu:
        """Return the present IMU sample; see `Robot`."""
        sample = super().imu()
        if self._fault != "tilted_imu":
            return sample
        w, x, y, z = sample.quat
        c, s = np.cos(TILT / 2.0), np.sin(TILT / 2.0)
        turned = np.array([c * w - s * x, c * x + s * w, c * y + s * z, c * z - s * y])
        return Imu(turned, sample.gyro, sample.acc)


def reported(fault: str, values: Array) -> Array:
    """Return what is reported of (27,) values of the joints under a fault; it is its own inverse."""
    out = values.copy()
    if fault == "swapped_joints":
        out[list(SWAPPED)] = values[list(reversed(SWAPPED))]
    elif fault == "wrong_sign":
        out[FLIPPED] = -values[FLIPPED]
    return out
