"""The node of the odometry hears all streams, publishes poses at its rate, and is silent while the module is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.capabilities.odometry.base import NO_COVARIANCE, Ignores, OdometryEstimate, Source
from golem.errors import ModuleFault
from golem.interfaces import topics
from golem.interfaces.lidar import ExternalOdometry, LegOdometry, LidarImu, LidarScan
from golem.interfaces.payloads import OdometrySilence
from golem.middleware.bus import Bus, News
from golem.runtime.contract_check import ContractCheck
from golem.runtime.lockstep import build
from golem.runtime.odometry_node import LidarNode, OdometryNode
from golem.stack import Choice, Stack
from golem.types import BaseEstimate, Imu, LowState

SCAN = LidarScan(0.1, np.zeros((3, 3), np.float32), np.zeros(3, np.float32), 0.1)
SAMPLE = LidarImu(0.1, np.zeros(3), np.zeros(3))


class Listens(Ignores):
    """Remembers what it was given, and says what it is told to say."""

    sources: tuple[Source, ...] = ("imu", "legs", "scan", "external")
    why = "It was told so."

    def __init__(self) -> None:
        self.heard: list[Any] = []
        self.says: Any = None

    def reset(self) -> None:
        self.heard.clear()

    def add_imu(self, sample: LidarImu) -> None:
        self.heard.append(sample)

    def add_legs(self, legs: LegOdometry) -> None:
        self.heard.append(legs)

    def add_scan(self, scan: LidarScan) -> None:
        self.heard.append(scan)

    def add_external(self, odometry: ExternalOdometry) -> None:
        self.heard.append(odometry)

    def estimate(self) -> OdometryEstimate | None:
        return self.says


def estimate(t: float) -> OdometryEstimate:
    return OdometryEstimate(t, np.eye(4), np.zeros(3), np.zeros(3), NO_COVARIANCE, np.eye(4))


@pytest.fixture
def bus() -> Bus:
    bus = Bus()
    q = np.zeros(27)
    q[12] = 0.3
    state = LowState(0.0, q, np.zeros(27), np.zeros(27), Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.zeros(3)))
    bus.publish(topics.LOW_STATE, state, 0.0)
    bus.publish(topics.BASE, BaseEstimate(0.0, np.eye(4), np.array([0.5, 0.0, 0.0])), 0.0)
    return bus


def test_it_hears_what_is_new_once_and_the_legs_every_10_ms(bus: Bus) -> None:
    odometry = Listens()
    node = OdometryNode(bus, odometry, ContractCheck("odometry", "listens"))
    bus.publish(topics.LIDAR_IMU, SAMPLE, 0.0)
    bus.publish(topics.LIDAR_SCAN, SCAN, 0.0)
    bus.publish(
        topics.EXTERNAL_ODOMETRY, ExternalOdometry(0.0, np.eye(4), np.zeros(3), np.zeros(3), np.zeros((6, 6))), 0.0
    )
    for k in range(6):
        node.step(0.002 * k)
    kinds = [type(one) for one in odometry.heard]
    assert kinds == [LidarImu, LegOdometry, LidarScan, ExternalOdometry, LegOdometry]
    legs = odometry.heard[1]
    assert legs.waist == 0.3 and legs.velocity[0] == 0.5


def test_it_publishes_every_10_ms_what_the_module_says_and_nothing_while_that_is_silent(bus: Bus) -> None:
    odometry = Listens()
    node = OdometryNode(bus, odometry, ContractCheck("odometry", "listens"))
    for k in range(50):
        odometry.says = None if k < 25 else estimate(0.002 * k)
        node.step(0.002 * k)
    assert bus.count(topics.ODOMETRY) == 5
    newest = bus.latest(topics.ODOMETRY)
    assert newest is not None and newest.t == pytest.approx(0.09)


def test_it_says_why_it_is_silent_once_and_when_it_no_longer_is(bus: Bus) -> None:
    odometry, said = Listens(), News(bus, topics.ODOMETRY_SILENCE)
    node = OdometryNode(bus, odometry, ContractCheck("odometry", "listens"))
    node.step(0.0)
    assert said.read() == OdometrySilence(0.0, "It was told so.")
    node.step(0.01)
    assert said.read() is None
    odometry.says = estimate(0.02)
    node.step(0.02)
    assert said.read() == OdometrySilence(0.02, "")


def test_a_wrong_answer_is_the_modules_fault(bus: Bus) -> None:
    odometry = Listens()
    odometry.says = np.eye(4)
    with pytest.raises(ModuleFault, match="odometry: listens"):
        OdometryNode(bus, odometry, ContractCheck("odometry", "listens")).step(0.0)


def test_the_lidar_is_read_only_while_somebody_listens(bus: Bus) -> None:
    asked: list[float] = []

    class Robot:
        def lidar(self, t: float) -> tuple[list[LidarImu], LidarScan | None]:
            asked.append(t)
            return [SAMPLE], SCAN

    wanted = False
    node = LidarNode(bus, Robot(), lambda: wanted, ContractCheck("robot", "still"))
    node.step(0.0)
    assert asked == [] and bus.count(topics.LIDAR_SCAN) == 0
    wanted = True
    node.step(0.002)
    assert asked == [0.002] and bus.count(topics.LIDAR_IMU) == bus.count(topics.LIDAR_SCAN) == 1


def test_legs_alone_publish_nothing_so_that_skills_go_by_the_base_estimate() -> None:
    running, robot = build(Stack(profile="ideal"), 0)
    running.executor.run(0.2)
    robot.close()
    assert running.bus.count(topics.ODOMETRY) == running.bus.count(topics.LIDAR_SCAN) == 0


@pytest.mark.slow
def test_a_stack_with_lio_knows_where_it_stands() -> None:
    robot = Choice("mujoco", {"support": "ground", "world": "furnished"})
    choices = {"robot": robot, "odometry": Choice("lio"), "lower_body": Choice("almi")}
    running, twin = build(Stack(choices, profile="bench"), 0)
    running.executor.run(4.0)
    found, true = running.bus.latest(topics.ODOMETRY), twin.truth
    T = np.linalg.inv(true.T_world_odom) @ true.base().T_world_base
    twin.close()
    assert found is not None and running.bus.count(topics.LIDAR_SCAN) > 30
    assert np.linalg.norm((found.T_odom_base - T)[:2, 3]) < 0.05
