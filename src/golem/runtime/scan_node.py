"""The node that poses scans: each point where the sensor was at the point's own time, without the robot's own."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from golem.capabilities.mapping.floor_plane import FloorPlane
from golem.capabilities.mapping.robot_filter import RobotFilter
from golem.capabilities.mapping.scan_kernel import posed, sound
from golem.interfaces import topics
from golem.interfaces.lidar import LidarScan
from golem.interfaces.nav_payloads import Scan
from golem.interfaces.payloads import Odometry
from golem.middleware.bus import Bus, News
from golem.robots.sensors.lidar_mount import LidarCorrection
from golem.types import Array

MEMORY = 0.6
"""How long poses are kept [s]."""
EARLY = 0.02
"""By how much a scan may begin before the oldest pose, or end after the newest [s]."""
BLIND = 0.35
"""Distance from the sensor within which a point is none of the world [m]."""


class ScanNode:
    """Publishes every scan in odom. One of a time of which no pose is known is left out, and one that came before."""

    period = math.inf
    wakes = topics.LIDAR_SCAN, topics.ODOMETRY

    def __init__(self, bus: Bus, mount: Array | None = None) -> None:
        """Read scans and odometry from `bus`, with the LiDAR at `mount` (4, 4) in the nominal lidar_link."""
        self._bus, self._correction = bus, LidarCorrection(mount)
        self._scans, self._poses = News(bus, topics.LIDAR_SCAN), News(bus, topics.ODOMETRY)
        self._track: deque[tuple[float, Array]] = deque()
        self._floor = FloorPlane()
        self._filter = RobotFilter()
        self._before: LidarScan | None = None

    def step(self, t: float) -> None:
        """Keep the newest pose, and pose the newest scan."""
        pose = self._poses.read()
        if pose is not None and pose.T_base_lidar is not None:
            self._keep(pose, pose.T_base_lidar)
        scan = self._scans.read()
        if scan is None or not self._track or _frozen(scan, self._before):
            return
        in_odom = self._posed(self._correction.scan(scan))
        if in_odom is not None:
            self._before = scan
            self._bus.publish(topics.SCAN, in_odom, t)

    def _keep(self, pose: Odometry, T_base_lidar: Array) -> None:
        if self._track and not 0.0 < pose.t - self._track[-1][0] < MEMORY:
            self._track.clear()  # it was lost, or began anew
        self._track.append((pose.t, pose.T_odom_base @ T_base_lidar))
        self._T_base_lidar = T_base_lidar
        while self._track[0][0] < pose.t - MEMORY:
            self._track.popleft()

    def _posed(self, scan: LidarScan) -> Scan | None:
        """Return a scan in odom; None where nobody knows where it was taken."""
        start, times = scan.t - scan.duration, np.array([t for t, _ in self._track])
        if not (times[0] - EARLY <= start and scan.t <= times[-1] + EARLY) or len(times) < 2:
            return None
        points, offsets = scan.points.astype(np.float64), scan.offsets.astype(np.float64)
        good = sound(points, offsets, BLIND)
        state = self._bus.latest(topics.LOW_STATE)
        if state is not None:
            T = self._T_base_lidar
            good &= ~self._filter.own(points @ T[:3, :3].T + T[:3, 3], state.q)
        points, offsets = points[good], np.clip(offsets[good], 0.0, scan.duration)
        if not len(points):
            return None
        # Poses at eleven moments of the scan, and the motion between two of them taken as a straight one.
        moments = np.clip(start + np.linspace(0.0, scan.duration, 11), times[0], times[-1])
        T = np.array([T for _, T in self._track])
        R = Slerp(times, Rotation.from_matrix(T[:, :3, :3]))(moments).as_matrix()
        p = np.column_stack([np.interp(moments, times, T[:, a, 3]) for a in range(3)])
        world = posed(points, offsets, scan.duration, R, p)
        return Scan(scan.t, world, p[-1], self._floor.update(world, p[-1]))


def _frozen(scan: LidarScan, before: LidarScan | None) -> bool:
    """Return whether a scan repeats the one before: a sensor that measures never says the same twice."""
    if before is None:
        return False
    if scan.t <= before.t:
        return True
    return (
        len(scan.points) > 0
        and scan.points.shape == before.points.shape
        and bool((scan.points[:50] == before.points[:50]).all())
    )
