"""KISS-ICP as odometry: LiDAR alone, point-to-point ICP with an adaptive threshold (Vizzo et al., RA-L 2023)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from golem.capabilities.odometry.base import Source, lidar_in_base
from golem.capabilities.odometry.scan_poses import ScanPoses
from golem.errors import needs
from golem.interfaces.lidar import LidarScan


@dataclass(frozen=True, slots=True)
class KissIcpConfig:
    """Options of `KissIcp`.

    Attributes:
        voxel: side of the map's voxels [m].
        far: range up to which points count [m].
        threads: threads of the registration.
    """

    voxel: float = 0.5
    far: float = 40.0
    threads: int = 1


class KissIcp(ScanPoses):
    """The package kiss-icp (extra `lidar`); see `LidarOdometry`. It takes base_link to be level when it begins."""

    sources: tuple[Source, ...] = ("scan",)

    def __init__(self, config: KissIcpConfig | None = None) -> None:
        """Wait for the first scan. Raises MissingExtra: the package is not installed."""
        self.config = config or KissIcpConfig()
        self.reset()

    def reset(self) -> None:
        self.start()
        self._icp = _icp(self.config)

    def add_scan(self, scan: LidarScan) -> None:
        taken = self.take(scan)
        if taken is None:
            return
        points, offsets = taken
        if self._icp.local_map.empty():
            self._icp.last_pose = lidar_in_base(self._waist)
        # Without a time per point the scan is rigid: with no times the package corrects no motion inside it.
        self._icp.register_frame(points, offsets if offsets.max() > offsets.min() else offsets[:0])
        self.tell(scan.t, self._icp.last_pose.copy())


def _icp(config: KissIcpConfig) -> Any:
    with needs("kiss-icp", "lidar"):
        from kiss_icp.config import KISSConfig
        from kiss_icp.config.config import DataConfig, MappingConfig, RegistrationConfig
        from kiss_icp.kiss_icp import KissICP
    data, mapping = DataConfig(max_range=config.far), MappingConfig(voxel_size=config.voxel)
    registration = RegistrationConfig(max_num_threads=config.threads)
    return KissICP(KISSConfig(data=data, mapping=mapping, registration=registration))
