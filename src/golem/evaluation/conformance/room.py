"""What LiDAR, IMU and legs of a robot say that stands, and then walks straight on, in an empty box."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from golem.capabilities.odometry.base import lidar_in_base
from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.interfaces.nav_payloads import Scan
from golem.robots.model.spatial import transform
from golem.robots.sensors.mid360 import IMU_PERIOD, P_LIDAR_IMU, POINT_RATE, SCAN, directions
from golem.types import Array

Reading = LidarImu | LegOdometry | LidarScan | ExternalOdometry
HEIGHT = 1.0
"""Of base_link above the floor [m]."""
BIAS: Array = np.array([0.002, -0.003, 0.001])
"""Of the gyro [rad/s]."""
ROOM: Array = np.array([[-3.0, 9.0], [-4.0, 5.0], [-HEIGHT, 2.5]])
"""Least and greatest x, y, z of the box [m]."""


@dataclass(frozen=True, slots=True)
class MadeWalk:
    """A walk along x in a box.

    Attributes:
        walls: (3, 2) of the box [m].
        still: time that the robot stands first [s].
        speed: with which it walks then, reached after 1 s [m/s].
        yaw: by which the LiDAR is turned about the vertical, unknown to the robot [rad].
        every: one point in so many is measured.
        legs: whether the legs report.
        shaking: standard deviation of what shakes the accelerometer [m/s^2].
    """

    walls: Array
    still: float = 1.5
    speed: float = 0.5
    yaw: float = 0.0
    every: int = 4
    legs: bool = True
    shaking: float = 0.03

    def way(self, t: float) -> float:
        """Return how far base_link has gone at `t` [s]."""
        s = max(t - self.still, 0.0)
        return 0.5 * self.speed * s * s if s < 1.0 else self.speed * (s - 0.5)

    @property
    def T_base_lidar(self) -> Array:
        """(4, 4) true pose of lidar_link in base_link."""
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return transform(np.zeros(3), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])) @ lidar_in_base(0.0)

    def scan(self, t: float, rng: np.random.Generator) -> LidarScan:
        """Return the scan that ends at `t` [s]."""
        offsets = np.arange(1, round(SCAN * POINT_RATE) + 1, self.every) / POINT_RATE
        T = self.T_base_lidar
        rays = directions(t - SCAN + offsets)
        world = rays @ T[:3, :3].T
        origin = np.tile(T[:3, 3], (len(offsets), 1))
        origin[:, 0] += np.interp(offsets, (0.0, SCAN), (self.way(t - SCAN), self.way(t)))
        faces = np.where(world > 0.0, self.walls[:, 1], self.walls[:, 0])
        with np.errstate(divide="ignore"):
            distance = ((faces - origin) / world).min(axis=1) + 0.02 * rng.standard_normal(len(rays))
        seen = distance < 40.0
        points = (rays[seen] * distance[seen, None]).astype(np.float32)
        return LidarScan(t, points, offsets[seen].astype(np.float32), SCAN)

    def base_scans(self, count: int, rng: np.random.Generator) -> list[Scan]:
        """Return the scans of the first `count` tenths of a second, in base_link."""
        T, floor = self.T_base_lidar, np.array([0.0, 0.0, -HEIGHT])
        found: list[Scan] = []
        for i in range(1, count + 1):
            with np.errstate(invalid="ignore"):  # a ray along a wall
                scan = self.scan(SCAN * i, rng)
            points = scan.points[np.isfinite(scan.points).all(axis=1)].astype(np.float64)
            found.append(Scan(scan.t, points @ T[:3, :3].T + T[:3, 3], T[:3, 3].copy(), floor))
        return found

    def tenths(self, seconds: float) -> Iterator[list[Reading]]:
        """Yield what is said in each tenth of a second, in the order of arrival."""
        rng = np.random.default_rng(1)
        T = self.T_base_lidar
        T_base_imu = T @ transform(P_LIDAR_IMU)
        said: list[Reading] = []
        for k in range(1, round(seconds / IMU_PERIOD) + 1):
            t, dt = IMU_PERIOD * k, IMU_PERIOD
            v0, v1 = (self.way(t) - self.way(t - dt)) / dt, (self.way(t + dt) - self.way(t)) / dt
            acc = T[:3, :3].T @ np.array([(v1 - v0) / dt, 0.0, 9.81])
            gyro = BIAS + 0.002 * rng.standard_normal(3)
            said.append(LidarImu(t, gyro, acc + self.shaking * rng.standard_normal(3)))
            if self.legs and k % 4 == 0:
                velocity = np.array([v0, 0.0, 0.0]) + 0.01 * rng.standard_normal(3)
                said.append(LegOdometry(t, transform((self.way(t), 0.0, HEIGHT)), velocity, 0.0))
            if k % 20 == 0:
                said.append(self.scan(t, rng))
                moved = np.linalg.inv(T_base_imu) @ transform((self.way(t), 0.0, 0.0)) @ T_base_imu
                v = T[:3, :3].T @ np.array([v0, 0.0, 0.0])
                said.append(ExternalOdometry(t, moved, v, np.zeros(3), np.zeros((6, 6))))
                yield said
                said = []
