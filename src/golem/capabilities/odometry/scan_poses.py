"""What adapters of LiDAR odometries share: which scans they are given, and a twist from one pose to the next."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.odometry import base
from golem.interfaces.lidar import LegOdometry, LidarScan
from golem.types import Array

FEWEST = 500
"""Points that a scan must have to be registered."""
LOST_AFTER = 1.0
"""Time between two scans from which on the later one may have been matched wrongly [s]."""


class ScanPoses(base.Ignores):
    """A `LidarOdometry` that says one pose per scan, of its end, and keeps it until the next; a subclass registers."""

    why = "No scan has come yet."

    def start(self) -> None:
        """Begin anew."""
        self._origin = base.OdomOrigin()
        self._waist = 0.0
        self._newest: base.OdometryEstimate | None = None
        self._ended = -math.inf
        self.why = "No scan has come yet."

    def add_legs(self, legs: LegOdometry) -> None:
        if math.isfinite(legs.waist):
            self._waist = legs.waist

    def estimate(self) -> base.OdometryEstimate | None:
        return self._newest

    def take(self, scan: LidarScan) -> tuple[Array, Array] | None:
        """Return the (n, 3) points [m] and (n,) times after the scan's begin [s] to be registered; None for none."""
        start = scan.t - scan.duration
        if not math.isfinite(scan.t) or start < self._ended - 1e-3:
            return None
        points = scan.points.astype(np.float64)
        offsets = scan.offsets.astype(np.float64)
        good = base.of_the_world(points, base.lidar_in_base(self._waist)) & np.isfinite(offsets)
        if good.sum() < FEWEST:
            self._lose(f"The scan of {scan.t:.1f} s has fewer than {FEWEST} points of the world.")
            return None
        return points[good], offsets[good]

    def tell(self, t: float, T_own_lidar: Array) -> None:
        """Take the (4, 4) pose of lidar_link in the method's own frame, whose z is up, at the end `t` [s] of a scan."""
        if not np.isfinite(T_own_lidar).all():
            self._lose(f"The scan of {t:.1f} s could not be registered.")
            return
        T_base_lidar = base.lidar_in_base(self._waist)
        T = self._origin(T_own_lidar @ np.linalg.inv(T_base_lidar))
        velocity, rate = np.zeros(3), np.zeros(3)
        if self._newest is not None and t - self._ended < LOST_AFTER:
            step = np.linalg.inv(self._newest.T_odom_base) @ T
            velocity = (T[:3, 3] - self._newest.T_odom_base[:3, 3]) / (t - self._ended)
            rate = Rotation.from_matrix(step[:3, :3]).as_rotvec() / (t - self._ended)
        self._newest, self._ended, self.why = (
            base.OdometryEstimate(t, T, velocity, rate, base.NO_COVARIANCE, T_base_lidar),
            t,
            "",
        )

    def _lose(self, why: str) -> None:
        self._newest, self.why = None, why
