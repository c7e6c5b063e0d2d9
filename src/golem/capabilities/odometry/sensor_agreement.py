"""Whether LiDAR, its IMU and the legs can be of one robot and of one clock, mounted as the model says."""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.odometry.base import BLIND, lidar_in_base
from golem.interfaces.lidar import LegOdometry, LidarImu, LidarScan
from golem.robots.sensors.mid360 import ELEVATION
from golem.types import GRAVITY, Array

LEAN = 0.15
"""Angle between up by the LiDAR's IMU and up by the torso's IMU from which they contradict each other [rad]."""
LEAN_ALONE = 0.5
"""The same against upright, where the torso's IMU says nothing [rad]."""
FAR_FROM_G = 1.0
"""How far the specific force at rest may be from gravity [m/s^2]."""
MARGIN, OUTSIDE = 0.05, 0.05
"""By how much a beam may leave the field of view [rad], and the share of points that may leave it by more."""
LATE, EARLY = 0.5, 0.1
"""By how much the end of a scan may be before, and after, the newest sample of the IMU [s]."""
SCANS, SAMPLES, VELOCITIES = 5, 40, 20
"""How many in a row must be wrong: scans (0.5 s), samples of the IMU (0.2 s), velocities of the legs (1 s)."""


class SensorAgreement:
    """Compares what the sensors say with each other; `why` says what cannot be, empty where all can."""

    def __init__(self) -> None:
        self.why = ""
        self._scans = self._samples = self._velocities = 0
        self._back = 0.0
        self._legs: LegOdometry | None = None

    def legs(self, said: LegOdometry) -> None:
        """Take what the legs say."""
        self._legs = said

    def stands(self, up: Array, force: float, t: float) -> bool:
        """Return whether the robot can begin so.

        Args:
            up: (3,) unit vector up in base_link, by the LiDAR's IMU and its nominal mount.
            force: mean specific force at rest [m/s^2].
            t: time [s].
        """
        legs = self._legs
        known = legs is not None and not legs.stale and abs(t - legs.t) < LATE
        own: Array = legs.T_odom_base[2, :3] if legs is not None and known else np.array([0.0, 0.0, 1.0])
        lean = math.acos(float(np.clip(up @ own, -1.0, 1.0)))
        if abs(force - GRAVITY) > FAR_FROM_G:
            self.why = f"The LiDAR's IMU says {force:.2f} m/s^2 at rest in place of 9.81: is it in g?"
        elif lean > (LEAN if known else LEAN_ALONE):
            self.why = (
                f"By the LiDAR's IMU the robot leans by {math.degrees(lean):.0f} degrees more than it does: the LiDAR "
                "is mounted otherwise than in the model, or its driver turns what it says."
            )
        else:
            self.why = ""
        return not self.why

    def imu(self, sample: LidarImu, newest: float) -> bool:
        """Return whether a sample is of the clock whose `newest` sample was at that time [s]."""
        if sample.t > newest:
            self._samples, self._back = 0, 0.0
            return True
        self._samples, self._back = self._samples + 1, max(self._back, newest - sample.t)
        if self._samples >= SAMPLES:
            self.why = f"The clock of the LiDAR's IMU has jumped back by {self._back:.2f} s."
        return False

    def scan(self, scan: LidarScan, newest: float) -> bool:
        """Return whether a scan fits the sensor's field of view, and the IMU's `newest` sample at that time [s]."""
        points = scan.points[::16].astype(np.float64)
        distance = np.linalg.norm(points, axis=1)
        seen = distance > BLIND  # not for nan
        elevation = np.arcsin(points[seen, 2] / distance[seen])
        outside = (elevation < ELEVATION[0] - MARGIN) | (elevation > ELEVATION[1] + MARGIN)
        why = ""
        if outside.size and outside.mean() > OUTSIDE:
            low, high = np.degrees(ELEVATION)
            why = (
                f"{100 * outside.mean():.0f} % of the points lie outside the LiDAR's field of view ({low:.0f} to "
                f"{high:.0f} degrees): its driver turns points and not the IMU, or it is another sensor."
            )
        elif not -EARLY <= (lag := newest - scan.t) <= LATE:
            side = "behind" if lag > 0.0 else "ahead of"
            why = f"The scans' stamps are {abs(lag):.2f} s {side} those of the LiDAR's IMU: they are of two clocks."
        self._scans = self._scans + 1 if why else 0
        if self._scans >= SCANS:
            self.why = why
        return not why

    def velocity(self, believed: bool) -> None:
        """Take whether a velocity of the legs fitted those of IMU and scans."""
        self._velocities = 0 if believed else self._velocities + 1
        if self._velocities >= VELOCITIES:
            self.why = (
                "The legs and the LiDAR contradict each other: it is mounted otherwise than in the model, its clock "
                "is another, or the soles slip."
            )


def up_in_base(R: Array, waist: float) -> Array:
    """Return the (3,) up in base_link, for an IMU with axes `R` (3, 3) in a level frame and a `waist` [rad]."""
    return lidar_in_base(waist)[:3, :3] @ R[2]
