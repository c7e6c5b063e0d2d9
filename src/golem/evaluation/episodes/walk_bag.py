"""Writes what the sensors said on a recorded walk into a bag that any odometry can replay, with the truth beside it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from golem.evaluation.episodes.lidar_walk import LidarWalk
from golem.interfaces import lidar_convert, public
from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.middleware.bags.base import BagMessage
from golem.middleware.bags.catalog import topic
from golem.middleware.bags.writer import BagConfig, BagWriter
from golem.middleware.ros import codec
from golem.types import Array

TRUTH = "/truth/odom"
"""Topic of the true pose of base_link in odom."""
ODOMETRY = "nav_msgs/msg/Odometry"
EVERY = 5
"""One report of the legs in so many is written: 100 per second."""
NO_COVARIANCE: Array = np.zeros((6, 6))


class WalkBag:
    """One bag. Times are the robot's: log times begin where the walk does."""

    def __init__(self, folder: Path, walk: LidarWalk) -> None:
        """Begin the bag `folder` for `walk`.

        Raises:
            MissingExtra: the extra `record` is not installed.
            OutputError: the folder exists, or cannot be written.
        """
        kinds = {name: public.topic(name).type for name in public.LIDAR}
        self._topics = {
            name: topic(name, kind) for name, kind in {**kinds, "/odom": ODOMETRY, TRUTH: ODOMETRY}.items()
        }
        self._walk, self._legs = walk, 0
        about = {"seed": str(walk.seed), "profile": walk.profile, "lost": walk.lost}
        self._writer = BagWriter(folder, BagConfig(compression="zstd"), about)

    def write(self, reading: LidarImu | LegOdometry | LidarScan) -> None:
        """Write one reading; with the legs goes what is true.

        Raises:
            OutputError: it cannot be written.
        """
        if isinstance(reading, LidarImu):
            self._write("/livox/imu", lidar_convert.imu(reading), reading.t)
        elif isinstance(reading, LidarScan):
            self._write("/livox/pointcloud", lidar_convert.cloud(reading), reading.t)
            self._write("/livox/lidar", lidar_convert.custom(reading), reading.t)
        else:
            self._legs += 1
            if self._legs % EVERY == 0:
                said = (reading.T_odom_base, reading.velocity, reading.rate)
                self._odometry("/odom", reading.t, *said)
                self._odometry(TRUTH, reading.t, self._walk.true_pose(reading.t), np.zeros(3), np.zeros(3))

    def close(self) -> None:
        """Finish the bag; closing twice does nothing."""
        self._writer.close()

    def _odometry(self, name: str, t: float, T: Array, velocity: Array, rate: Array) -> None:
        message = lidar_convert.odometry(
            ExternalOdometry(t, T, velocity, rate, NO_COVARIANCE, public.BASE_FRAME)
        )
        message.header.frame_id = "odom"
        self._write(name, message, t)

    def _write(self, name: str, message: Any, t: float) -> None:
        at = round(1e9 * t)
        self._writer.write(BagMessage(self._topics[name], at, at, codec.serialize(message)))
