"""The nodes behind the LiDAR: the odometry, which hears legs and whoever is outside, too; the scan; the map."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from golem.capabilities.mapping.base import Mapper
from golem.capabilities.mapping.floor_plane import FloorPlane
from golem.capabilities.mapping.map_file import StoredMap, save_map
from golem.capabilities.mapping.robot_filter import RobotFilter, posed, sound
from golem.capabilities.odometry.base import LidarOdometry, OdometryEstimate
from golem.errors import OutputError
from golem.interfaces import topics
from golem.interfaces.lidar import LegOdometry, LidarScan
from golem.interfaces.nav_payloads import HERE, MapFile, MapPlace, OccupancyGrid, Scan
from golem.interfaces.payloads import Odometry, OdometrySilence
from golem.middleware.bus import Bus, News
from golem.robots.base import HasLidar
from golem.robots.model.imu_mount import TORSO, sensed_base_rate
from golem.robots.sensors.calibration import LidarCorrection
from golem.runtime.contract_check import ContractCheck
from golem.runtime.executor import Node
from golem.types import TICK, Array, PlanarPose

MEMORY = 0.6
"""How long poses are kept [s]."""
EARLY = 0.02
"""By how much a scan may begin before the oldest pose, or end after the newest [s]."""
BLIND = 0.35
"""Distance from the sensor within which a point is none of the world [m]."""


class ScanNode(Node):
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


class MapperNode(Node):
    """Runs a mapper: every scan at once, a grid when one is due and something new was seen."""

    period = math.inf
    wakes = topics.SCAN, topics.MAP_SAVE

    def __init__(self, bus: Bus, mapper: Mapper, contract: ContractCheck) -> None:
        self._bus, self._mapper, self._contract = bus, mapper, contract
        self._every = 1.0 / contract.number("rate", mapper.rate, minimum=0.1)
        self._scans = News(bus, topics.SCAN)
        self._wanted = News(bus, topics.MAP_SAVE)
        self._due = 0.0

    def step(self, t: float) -> None:
        wanted = self._wanted.read()
        if wanted is not None:
            self._bus.publish(topics.MAP_SAVED, self._kept(wanted.path), t)
        scan = self._scans.read()
        if scan is None:
            return
        call = self._contract.call
        call(self._mapper.add_scan, scan)
        place = call(lambda: self._mapper.T_odom_map)
        if place is not None:
            self._contract.kind("T_odom_map", place, PlanarPose)
            for name in ("x", "y", "yaw"):
                self._contract.number(f"T_odom_map.{name}", getattr(place, name))
            self._bus.publish(topics.MAP_POSE, MapPlace(t, place, self._estimate_in_map(place)), t)
        if t < self._due - 1e-9:
            return
        self._due = t + self._every
        grid = call(self._mapper.grid)
        if grid is not None:
            self._contract.kind("the grid", grid, OccupancyGrid)
            cells = self._contract.array("cells", grid.cells, None, None)
            if cells.dtype != np.int8:
                raise self._contract.fault(f"cells are {cells.dtype}, the contract asks for int8")
            self._contract.number("resolution", grid.resolution, minimum=1e-3)
            self._bus.publish(topics.MAP, grid, t)

    def _kept(self, path: str) -> MapFile:
        stored = self._contract.call(self._mapper.stored)
        if stored is None:
            return MapFile(path, "There is no map yet.")
        self._contract.kind("what it stores", stored, StoredMap)
        try:
            save_map(Path(path), stored)
        except OutputError as problem:
            return MapFile(path, str(problem))
        return MapFile(path)

    def _estimate_in_map(self, T_odom_map: PlanarPose) -> PlanarPose:
        """Return where odom of the base estimate is in the map: /tf has base_link in that odom."""
        odometry, base = self._bus.latest(topics.ODOMETRY), self._bus.latest(topics.BASE)
        if odometry is None or base is None:
            return T_odom_map.to(HERE)
        T_map_base = T_odom_map.to(PlanarPose.of(odometry.T_odom_base))
        return T_map_base @ PlanarPose.of(base.T_odom_base).to(HERE)


PERIOD = 0.01
"""Time between two poses that are published, and between two words of the legs [s]."""


class OdometryNode(Node):
    """Runs an odometry that goes by more than the legs. While that is silent, so is the node."""

    period = PERIOD
    wakes = topics.LIDAR_IMU, topics.LIDAR_SCAN, topics.EXTERNAL_ODOMETRY

    def __init__(self, bus: Bus, odometry: LidarOdometry, contract: ContractCheck, mount: Array | None = None) -> None:
        """Run `odometry`, with the LiDAR at `mount` (4, 4) in the nominal lidar_link; None is there."""
        self._bus, self._odometry, self._contract = bus, odometry, contract
        self._correction = LidarCorrection(mount)
        self._imu = News(bus, topics.LIDAR_IMU)
        self._scan = News(bus, topics.LIDAR_SCAN)
        self._external = News(bus, topics.EXTERNAL_ODOMETRY)
        self._next = 0.0
        self._why = ""

    def step(self, t: float) -> None:
        call, odometry = self._contract.call, self._odometry
        if (sample := self._imu.read()) is not None:
            call(odometry.add_imu, self._correction.imu(sample))
        due = t >= self._next - 1e-9
        if due:
            self._add_legs(t)
        if (scan := self._scan.read()) is not None:
            call(odometry.add_scan, self._correction.scan(scan))
        if (external := self._external.read()) is not None:
            call(odometry.add_external, external)
        if not due:
            return
        self._next = t + PERIOD
        estimate = call(odometry.estimate)
        if estimate is not None:
            self._contract.kind("the estimate", estimate, OdometryEstimate)
            T = self._contract.array("T_odom_base", estimate.T_odom_base, 4, 4)
            T_lidar = self._contract.array("T_base_lidar", estimate.T_base_lidar, 4, 4)
            known = estimate.covariance if np.isfinite(estimate.covariance).all() else None
            self._bus.publish(topics.ODOMETRY, Odometry(float(estimate.t), T, T_lidar, known), t)
        why = odometry.why if estimate is None else ""
        if why != self._why:
            self._why = why
            self._bus.publish(topics.ODOMETRY_SILENCE, OdometrySilence(t, why), t)

    def _add_legs(self, t: float) -> None:
        state, base = self._bus.latest(topics.LOW_STATE), self._bus.latest(topics.BASE)
        if state is None or base is None:
            return
        T = base.T_odom_base
        v, rate = T[:3, :3].T @ base.velocity, sensed_base_rate(state)
        self._contract.call(self._odometry.add_legs, LegOdometry(t, T, v, float(state.q[TORSO]), base.stale, rate))


class LidarNode(Node):
    """Publishes what the LiDAR of a robot says: every tick, or as often as its IMU has a sample."""

    def __init__(self, bus: Bus, robot: HasLidar, wanted: Callable[[], bool], contract: ContractCheck) -> None:
        """Read the LiDAR of `robot`, while `wanted` says that somebody listens."""
        self._bus, self._robot, self._wanted, self._contract = bus, robot, wanted, contract
        self.period = contract.number("lidar_period", getattr(robot, "lidar_period", TICK), TICK)

    def step(self, t: float) -> None:
        if not self._wanted():
            return
        samples, scan = self._contract.call(self._robot.lidar, t)
        for sample in samples:
            self._bus.publish(topics.LIDAR_IMU, sample, t)
        if scan is not None:
            self._bus.publish(topics.LIDAR_SCAN, scan, t)
