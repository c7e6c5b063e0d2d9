"""RKO-LIO as odometry: LiDAR and IMU, point-to-point ICP around the IMU's prediction (Malladi et al., RA-L 2026)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from golem.capabilities.odometry.base import Source
from golem.capabilities.odometry.scan_poses import ScanPoses
from golem.capabilities.odometry.still_start import StillStart
from golem.errors import needs
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.robots.model.spatial import transform
from golem.robots.sensors.mid360 import P_LIDAR_IMU
from golem.types import Array

ORIGIN = 1_000_000_000
"""What is added to all times [ns]: the package takes a time of zero for none."""
LEVELLED = 2
"""The scan from which the package's frame is level."""
IMU_LAG = 0.1
"""How far the IMU's newest sample may be behind a scan's end [s]."""


@dataclass(frozen=True, slots=True)
class RkoLioConfig:
    """Options of `RkoLio`.

    Attributes:
        voxel: side of the map's voxels [m].
        near, far: ranges between which points count [m].
        reach: distance up to which two points may be the same [m].
        min_beta: least weight of the IMU's up direction; -1 switches it off.
        threads: threads of the registration.
    """

    voxel: float = 0.5
    near: float = 0.5
    far: float = 40.0
    reach: float = 0.5
    min_beta: float = 200.0
    threads: int = 1


class RkoLio(ScanPoses):
    """The package rko-lio (extra `lidar`); see `LidarOdometry`. It begins once the robot stands still."""

    sources: tuple[Source, ...] = ("imu", "scan")

    def __init__(self, config: RkoLioConfig | None = None) -> None:
        """Wait for IMU and scans. Raises MissingExtra: the package is not installed."""
        self.config = config or RkoLioConfig()
        self.reset()

    def reset(self) -> None:
        self.start()
        self._lio = _lio(self.config)
        self._still = StillStart()
        self._imu_t, self._begun, self._scans = -math.inf, math.inf, 0

    def add_imu(self, sample: LidarImu) -> None:
        finite = np.isfinite(sample.gyro).all() and np.isfinite(sample.acc).all() and math.isfinite(sample.t)
        if not finite or sample.t <= self._imu_t:
            return
        if self._begun == math.inf:
            if self._still.add(sample, self._waist) is None:
                return
            self._begun = sample.t
        self._imu_t = sample.t
        self._lio.add_imu_measurement(sample.acc, sample.gyro, _ns(sample.t), np.eye(4))

    def add_scan(self, scan: LidarScan) -> None:
        if scan.t - scan.duration < self._begun or scan.t > self._imu_t + IMU_LAG:
            return  # before the start, of another clock, or there is no IMU
        taken = self.take(scan)
        if taken is None:
            return
        points, offsets = taken
        start = _ns(scan.t - scan.duration)
        times = start + np.round(1e9 * offsets).astype(np.int64)
        try:
            self._lio.register_scan(points, times, T_IMU_LIDAR, start, _ns(scan.t))
        except RuntimeError as error:
            self._lose(f"The scan of {scan.t:.1f} s could not be registered: {error}.")
            return
        self._scans += 1
        if self._scans >= LEVELLED:
            self.tell(scan.t, self._lio.pose() @ T_IMU_LIDAR)


T_IMU_LIDAR: Array = transform(-P_LIDAR_IMU)
"""(4, 4) pose of lidar_link at the IMU inside it, whose axes are the same."""


def _ns(t: float) -> int:
    return ORIGIN + round(1e9 * t)


def _lio(config: RkoLioConfig) -> Any:
    with needs("rko-lio", "lidar"):
        from rko_lio.config import LIOConfig
        from rko_lio.lio import LIO
    return LIO(
        LIOConfig(
            voxel_size=config.voxel,
            min_range=config.near,
            max_range=config.far,
            max_correspondence_distance=config.reach,
            min_beta=config.min_beta,
            max_num_threads=config.threads,
            initialization_phase=True,
        )
    )
