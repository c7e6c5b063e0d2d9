"""A map of a hall from before: what a LiDAR saw from known places, before walls and obstacles were put up."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np

from golem.capabilities.mapping.floor_plane import FloorPlane
from golem.capabilities.mapping.map_file import save_map
from golem.capabilities.mapping.robot_filter import RobotFilter
from golem.capabilities.mapping.voxel_grid import VoxelGridMapper
from golem.capabilities.odometry.base import lidar_in_base
from golem.interfaces.nav_payloads import Scan
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.mujoco.lidar_sensor import LidarMoment, LidarSensor
from golem.robots.mujoco.scene import build_scene
from golem.types import TICK, Array, PlanarPose

PLACES = (
    PlanarPose(0.0, 0.0, 0.0),
    PlanarPose(2.0, 1.5, 1.6),
    PlanarPose(4.0, -0.5, -1.6),
    PlanarPose(6.0, 0.5, 3.1),
    PlanarPose(5.5, 1.0, 0.0),
)
"""Where the surveyor stood, in odom of the robot at its start."""
SCANS = 3
"""Scans from each place."""


def survey(robot: MujocoRobot, seed: int, path: Path) -> None:
    """Write the map of the hall in which `robot` stands, without its obstacles, into `path`.

    Its frame is odom at the robot's true start. The surveyor's sensor has the noise of the robot's, and hangs straight.
    """
    scene = build_scene(replace(robot.config, obstacles=0, people=0), robot.scene.nominal, robot.profile, seed)
    mapper, floor, t = VoxelGridMapper(), FloorPlane(), 0.0
    joint = int(scene.model.joint("base").qposadr[0])
    start: Array = robot.data.qpos.copy()
    height = float(start[joint + 2])  # pyright: ignore[reportCallIssue, reportArgumentType]
    T_base_lidar, joints, filter = lidar_in_base(0.0), robot.joints()[0], RobotFilter()
    for place in PLACES:
        qpos = start.copy()
        half = 0.5 * place.yaw
        qpos[joint : joint + 7] = (place.x, place.y, height, np.cos(half), 0.0, 0.0, np.sin(half))
        T = place.matrix() @ T_base_lidar
        with closing(LidarSensor(scene, robot.profile.name, seed + 1, mount=np.eye(4))) as sensor:
            for i in range(round((0.1 * SCANS + 0.05) / TICK)):
                sensor.observe(LidarMoment(t + i * TICK, qpos, np.zeros(scene.model.nv)))
                scan = sensor.read_scan(t + i * TICK)
                if scan is None:
                    continue
                points = scan.points.astype(np.float64)
                in_base = points @ T_base_lidar[:3, :3].T + T_base_lidar[:3, 3]
                points = points[~filter.own(in_base, joints)] @ T[:3, :3].T + T[:3, 3]
                mapper.add_scan(Scan(scan.t, points, T[:3, 3], floor.update(points, T[:3, 3])))
        t += 1.0
    stored = mapper.stored()
    assert stored is not None
    save_map(path, stored)
