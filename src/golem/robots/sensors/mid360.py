"""The Livox MID-360: where it looks, what it gets wrong, and how it hangs on the robot.

The scan pattern is a formula of our own with the published properties of the sensor: 360 degrees around, -7 to 52
degrees up, 200,000 points per second, and directions that do not repeat. Four beams turn ten times a second and nod;
turning and nodding are not commensurate, so that every turn fills gaps of those before. The order of the points and
the density over the elevation are not those of the product.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from golem.errors import unknown_name
from golem.kernels import njit
from golem.options import fill
from golem.package_data import load_data
from golem.robots.model.spatial import transform
from golem.robots.sensors.imu import ImuErrors
from golem.robots.sensors.streams import stream
from golem.types import Array

POINT_RATE = 200_000
"""Points per second [vendor]."""
SCAN = 0.1
"""Time of one scan [s] [vendor: 10 Hz]."""
IMU_PERIOD = 0.005
"""Time between two samples of the IMU inside [s] [vendor: 200 Hz]."""
ELEVATION = (np.deg2rad(-7.0), np.deg2rad(52.0))
"""Lowest and highest elevation in the sensor's frame [rad] [vendor]."""
P_LIDAR_IMU: Array = np.array([0.011, 0.02329, -0.04412])
"""(3,) the IMU in lidar_link [m] [vendor]; its axes are the LiDAR's."""
BEAMS = 4
"""Beams that fire in turn."""
TURNS = 10.0
"""Turns of the beams per second."""
NODS = TURNS * (43.0 + (5.0**0.5 - 1.0) / 2.0 / BEAMS)
"""Nods of the beams per second [own]: each turn is shifted by the golden section of the gap between two beams.

Seventeen nods per turn leave lines that stand still in the sensor's frame over many scans. Point-to-point registration
then matches lines with lines, and takes a robot that walks for one that stands.
"""


@dataclass(frozen=True, slots=True)
class LidarErrors:
    """Magnitudes of the errors of the LiDAR and of its mounting; the defaults leave only the range limits.

    Attributes:
        range_noise: standard deviation of a range [m].
        direction_noise: standard deviation of a direction, per axis [rad].
        dropout: share of the points that are lost, 0 to 1.
        near, far: ranges outside which there is no point [m].
        imu: errors of the IMU inside.
        mount_rotation: standard deviation of the mounting error, per axis [rad].
        mount_translation: the same of its place [m].
    """

    range_noise: float = 0.0
    direction_noise: float = 0.0
    dropout: float = 0.0
    near: float = 0.1
    far: float = 40.0
    imu: ImuErrors = ImuErrors()
    mount_rotation: float = 0.0
    mount_translation: float = 0.0

    def draw_mount(self, rng: np.random.Generator) -> Array:
        """Return the (4, 4) pose of the real lidar_link in the one that the robot's model has."""
        R = Rotation.from_rotvec(self.mount_rotation * rng.standard_normal(3)).as_matrix()
        return transform(self.mount_translation * rng.standard_normal(3), R)


LIDAR_PROFILES: dict[str, LidarErrors] = {
    name: fill(f"key of {name}", LidarErrors, rows) for name, rows in load_data(__package__, "lidar.yaml").items()
}
"""Errors of the LiDAR by realism profile; `lidar.yaml`, beside this file, names the source of each number."""


def lidar_errors(profile: str) -> LidarErrors:
    """Return the errors of a realism profile. Raises ConfigError: there is no profile of that name."""
    if profile not in LIDAR_PROFILES:
        raise unknown_name("profile", profile, LIDAR_PROFILES)
    return LIDAR_PROFILES[profile]


def draw_mount(profile: str, seed: int) -> Array:
    """Return the (4, 4) mounting error of one episode; see `LidarErrors.draw_mount`."""
    return lidar_errors(profile).draw_mount(stream(seed, "lidar/mount"))


@njit(cache=True, nogil=True, error_model="numpy")
def directions(t: Array) -> Array:
    """Return where the sensor looks at (n,) times `t` [s], (n, 3) unit vectors in lidar_link."""
    out = np.empty((len(t), 3))
    low, high = ELEVATION
    for i in range(len(t)):
        beam = round(t[i] * POINT_RATE) % BEAMS
        azimuth = 2.0 * np.pi * ((TURNS * t[i]) % 1.0)
        # The beams nod a quarter of a period apart; a triangle wave spreads the points evenly over the elevation.
        nod = (NODS * t[i] + beam / BEAMS) % 1.0
        elevation = low + (high - low) * (1.0 - abs(2.0 * nod - 1.0))
        flat = math.cos(elevation)
        out[i, 0], out[i, 1], out[i, 2] = (flat * math.cos(azimuth), flat * math.sin(azimuth), math.sin(elevation))
    return out
