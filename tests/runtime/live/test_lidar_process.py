"""A MID-360 on a domain, in simulated time: its datagrams come over the loopback, its messages over the domain."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from tests.hardware.drivers.mid360_peer import PERIOD, POINTS, Mid360Peer

from golem.hardware.drivers.mid360_driver import Mid360
from golem.interfaces import public, ros_convert
from golem.interfaces.images import to_points
from golem.middleware.dds.local import LocalDomain
from golem.middleware.ros.msgs.rosgraph_msgs import Clock
from golem.middleware.ros.node import RosNode
from golem.runtime.live.device_process import CLOUD, IMU, DriverPlace, LidarProcess

BEGIN, ROBOT_TIME = 1000.0, 50.0
"""What our clock and the robot's show when the LiDAR begins."""


class Rig:
    """A LiDAR, its process, and somebody who listens."""

    def __init__(self) -> None:
        domain = LocalDomain()
        here, there = domain.participant(), domain.participant()
        self.now = BEGIN
        self.ticking = True
        self.lines: list[str] = []
        self.lidar = Mid360("127.0.0.1", point_port=0, imu_port=0)
        self.peer = Mid360Peer(self.lidar.ports)
        self.listener = RosNode(there, "listener")
        place = DriverPlace(here, RosNode(here, "lidar"), lambda: self.now, self.lines.append)
        self.process = LidarProcess(place, self.lidar)
        row = public.topic("/clock")
        self.clock = self.listener.publisher(row.name, row.type, row.qos)
        self.heard: dict[str, list[Any]] = {CLOUD: [], IMU: []}
        for name, messages in self.heard.items():
            row = public.topic(name)
            self.listener.subscription(name, row.type, messages.append, row.qos)

    def run(self, datagrams: int, drop: frozenset[int] = frozenset(), sends: bool = True) -> None:
        """Let the LiDAR send, and its process look every ten datagrams."""
        for _ in range(datagrams // 10):
            if sends:
                self.peer.run(10, drop)
            self.now += 1e-8 * PERIOD
            if self.ticking:
                self.clock.publish(Clock(ros_convert.time(self.now - BEGIN + ROBOT_TIME)))
            self.process.step()
            self.listener.poll()


@pytest.fixture
def rig() -> Iterator[Rig]:
    rig = Rig()
    yield rig
    rig.lidar.close()
    rig.peer.close()


def test_clouds_and_samples_bear_the_robots_time(rig: Rig) -> None:
    rig.run(1100)
    clouds, samples = rig.heard[CLOUD], rig.heard[IMU]
    assert len(clouds) == 5 and 100 <= len(samples) <= 107
    points = to_points(clouds[2])
    begin = ros_convert.seconds(clouds[2].header.stamp)
    assert begin == pytest.approx(ROBOT_TIME + 0.2, abs=0.006) and clouds[2].header.frame_id == "lidar_link"
    assert len(points) == POINTS * 208 or len(points) == POINTS * 209
    assert 1e-9 * points["timestamp"][0] == pytest.approx(begin, abs=5e-4)
    assert (np.diff(points["timestamp"]) >= 0).all()
    assert np.abs(points["x"]).max() < 9.0
    assert samples[-1].linear_acceleration.z == pytest.approx(9.80665)
    assert samples[-1].orientation_covariance[0] == -1.0
    assert ros_convert.seconds(samples[-1].header.stamp) == pytest.approx(rig.now - BEGIN + ROBOT_TIME, abs=0.012)
    assert rig.lines == []


def test_without_the_robots_time_nothing_is_published(rig: Rig) -> None:
    rig.ticking = False
    rig.run(1000)
    assert rig.heard == {CLOUD: [], IMU: []}


def test_silence_and_losses_are_said(rig: Rig) -> None:
    rig.run(300, drop=frozenset((40, 41)))
    rig.run(1100, sends=False)
    assert rig.lines == ["The LiDAR is silent."]
    rig.run(300)
    assert rig.lines[1:] == ["The LiDAR is heard."]
    rig.run(20_000, sends=False)
    assert f"Lost {2 * POINTS} points; 0 datagrams are none of a MID-360." in rig.lines
