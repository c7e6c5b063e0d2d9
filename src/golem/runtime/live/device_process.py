"""`golem drivers hands`, `lidar` and `camera`: real devices on a domain, in the place of the twin's."""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal, NamedTuple, Protocol

from tyro.conf import OmitArgPrefixes, Positional

from golem.errors import ConfigError
from golem.hardware.drivers.magpie_servos import HandFault, MagpieServoConfig, MagpieServos
from golem.hardware.drivers.mid360_driver import IMU_PORT, POINT_PORT, Mid360
from golem.hardware.drivers.realsense_camera import RealSense, device_frames
from golem.interfaces import lidar_convert, public
from golem.interfaces.lidar import LidarScan
from golem.interfaces.payloads import Exposure
from golem.interfaces.ros_convert import seconds
from golem.middleware.dds.base import Participant
from golem.middleware.dds.domain import DdsConfig
from golem.middleware.interrupt import interrupted
from golem.middleware.ros.node import RosNode
from golem.robots.sensors.cameras import CAMERAS
from golem.runtime.live.clock import Every
from golem.runtime.live.node_setup import AsyncLogger, log_line, member
from golem.runtime.live.role_endpoints import RoleEndpoints
from golem.types import TICK, Side

SILENCE = 0.2
"""Time without a /clock after which nobody knows the robot's time [s]."""


class RobotTime:
    """Turns this process's time into the robot's, by /clock."""

    def __init__(self, node: RosNode, clock: Callable[[], float]) -> None:
        """Listen to /clock through `node`; `clock` is this process's own [s]."""
        self._clock = clock
        self._newest: tuple[float, float] | None = None
        row = public.topic("/clock")
        node.subscription(row.name, row.type, self._take, row.qos)

    def at(self, t: float) -> float | None:
        """Return the robot's time at our time `t` [s]; None while no clock is heard."""
        if self._newest is None:
            return None
        robot, heard = self._newest
        return robot + t - heard if self._clock() - heard < SILENCE else None

    def _take(self, message: Any) -> None:
        self._newest = (seconds(message.clock), self._clock())


CLOUD, IMU = "/livox/pointcloud", "/livox/imu"
SILENT = 0.5
"""Time without a scan after which the LiDAR counts as silent [s]: five scans."""
REPORT = 10.0
"""Time between two reports of what was lost [s]."""


@dataclass(frozen=True)
class HandsConfig:
    """Drive the MAGPIE hands whose ports are named, until Ctrl-C; they keep what they hold."""

    left: MagpieServoConfig = field(default_factory=MagpieServoConfig)
    """The left hand."""
    right: MagpieServoConfig = field(default_factory=MagpieServoConfig)
    """The right hand."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class LidarConfig:
    """Publish points and IMU of a MID-360 until Ctrl-C. Tell it our address with the vendor's tool first."""

    host: Positional[str]
    """Our address on the LiDAR's network, e.g. 192.168.1.50."""
    device: str | None = None
    """Address of the LiDAR; without it the first one that is heard."""
    point_port: int = POINT_PORT
    """Our port for points."""
    imu_port: int = IMU_PORT
    """Our port for the IMU."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


@dataclass(frozen=True)
class CameraConfig:
    """Publish the images of one RealSense camera until Ctrl-C."""

    camera: Positional[Literal["head", "left_hand", "right_hand"]]
    """Which of the robot's cameras it is."""
    serial: Positional[str]
    """Its serial number, or a recording (.bag, .db3)."""
    dds: OmitArgPrefixes[DdsConfig] = field(default_factory=DdsConfig)


class Measurement(NamedTuple):
    """A measurement of a device.

    Attributes:
        topic: name of its stream.
        value: a dataclass with the time `t` of this process's clock [s].
        encode: makes the message; None is what the table of streams says.
    """

    topic: str
    value: Any
    encode: Callable[[Any], Any] | None = None


@dataclass(frozen=True)
class DriverPlace:
    """Where a driver runs: it is a member of a domain, stamps by `clock` [s], and `tell` says a line to a person."""

    participant: Participant
    node: RosNode
    clock: Callable[[], float] = time.monotonic
    tell: Callable[[str], None] = log_line


class DeviceProcess(ABC):
    """A device without its loop: what it measures is sent with the robot's time, what is wrong is told once."""

    def __init__(self, place: DriverPlace, topics: Collection[str]) -> None:
        self.clock, self.tell = place.clock, place.tell
        self.endpoints = RoleEndpoints("robot", place.participant, place.node, topics)
        self._robot_time = RobotTime(place.node, place.clock)
        self._faults: dict[str, str] = {}

    def step(self) -> None:
        """Take what has come, and send what was measured."""
        now = self.clock()
        self.endpoints.step(now)
        for topic, value, encode in self.measured(now):
            t = self._robot_time.at(value.t)
            if t is not None and not math.isnan(t):
                self.endpoints.send(topic, replace(value, t=t), encode)

    @abstractmethod
    def measured(self, now: float) -> Iterable[Measurement]:
        """Return what the device has measured since the last time; `now` is this process's time [s]."""

    def fault(self, device: str, fault: str) -> None:
        """Say that `device` has a fault, or that it works again where that is empty, unless that was said last."""
        if fault != self._faults.get(device, ""):
            self._faults[device] = fault
            self.tell(f"{device}: {fault or 'it works again.'}")


class HandProcess(DeviceProcess):
    """The hands. One that fails is named once, and reports nothing until it works again."""

    def __init__(self, place: DriverPlace, hands: Mapping[Side, MagpieServos]) -> None:
        """Take commands for `hands` and send their reports."""
        super().__init__(place, {public.gripper(side, "state") for side in hands})
        self._hands = hands
        for side in hands:
            self.endpoints.listen(public.gripper(side, "command"), hands[side].command)

    def measured(self, now: float) -> Iterable[Measurement]:
        for side, hand in self._hands.items():
            try:
                report = hand.step(now)
            except HandFault as fault:
                self.fault(f"{side} hand", str(fault))
                continue
            if report is not None:
                self.fault(f"{side} hand", "")
                yield Measurement(public.gripper(side, "state"), report)


class LidarProcess(DeviceProcess):
    """The LiDAR. Silence is told, and what was lost, and nothing else."""

    def __init__(self, place: DriverPlace, lidar: Mid360) -> None:
        super().__init__(place, (CLOUD, IMU))
        self._lidar = lidar
        self._heard, self._silent = place.clock(), False
        self._reports, self._lost = Every(REPORT), (0, 0)

    def measured(self, now: float) -> Iterable[Measurement]:
        for value in self._lidar.step(now):
            if isinstance(value, LidarScan):
                self._heard = now
                yield Measurement(CLOUD, value, lidar_convert.cloud)
            else:
                yield Measurement(IMU, value, lidar_convert.imu)
        self._report(now)

    def _report(self, now: float) -> None:
        silent = now - self._heard > SILENT
        if silent != self._silent:
            self._silent = silent
            self.tell("The LiDAR is silent." if silent else "The LiDAR is heard.")
        lost = (self._lidar.lost, self._lidar.malformed)
        if self._reports.due(now) and lost != self._lost:
            points, malformed = (new - old for new, old in zip(lost, self._lost, strict=True))
            self._lost = lost
            self.tell(f"Lost {points} points; {malformed} datagrams are none of a MID-360.")


class ExposureSource(Protocol):
    """What images come from."""

    @property
    def fault(self) -> str:
        """Why there are none; empty while they come."""
        ...

    def step(self) -> Exposure | None:
        """Return a new one."""
        ...


class CameraProcess(DeviceProcess):
    """One camera."""

    def __init__(self, place: DriverPlace, name: str, source: ExposureSource) -> None:
        """Publish what `source` sees as the images of the camera called `name`."""
        self._name, self._source = name, source
        self._topics = [public.image(name, what) for what in public.IMAGES]
        super().__init__(place, self._topics)

    def measured(self, now: float) -> Iterable[Measurement]:
        exposure = self._source.step()
        self.fault(f"{self._name} camera", self._source.fault)
        return [] if exposure is None else [Measurement(topic, exposure) for topic in self._topics]


def run_hands(config: HandsConfig) -> None:
    """Drive the hands until Ctrl-C.

    Raises:
        ConfigError: no port is named.
        MissingExtra, PortError: a port cannot be opened.
        DdsError: the domain cannot be joined.
    """
    sides: dict[Side, MagpieServoConfig] = {"left": config.left, "right": config.right}
    ports: dict[Side, MagpieServoConfig] = {side: hand for side, hand in sides.items() if hand.port}
    if not ports:
        raise ConfigError("Name the port of a hand: --left.port /dev/ttyUSB0, --right.port /dev/ttyUSB1.")
    with ExitStack() as opened:
        hands: dict[Side, MagpieServos] = {s: opened.enter_context(closing(MagpieServos(h))) for s, h in ports.items()}
        words = f"Hands on {config.dds}: {', '.join(hands)}. Ctrl-C ends their driver; they keep what they hold."
        _drive("hands", config.dds, words, partial(HandProcess, hands=hands))


def run_lidar(config: LidarConfig) -> None:
    """Publish until Ctrl-C. Raises LidarError: a port cannot be opened; DdsError: the domain cannot be joined."""
    with closing(Mid360(config.host, config.device, config.point_port, config.imu_port)) as lidar:
        words = f"The LiDAR that sends to {config.host} is on {config.dds}. Ctrl-C ends its driver."
        _drive("lidar", config.dds, words, partial(LidarProcess, lidar=lidar))


def run_camera(config: CameraConfig) -> None:
    """Publish until Ctrl-C.

    Raises:
        CameraError: the camera cannot be started.
        MissingExtra, MissingSystemLibrary: pyrealsense2 or what it needs is absent.
        DdsError: the domain cannot be joined.
    """
    name, wanted = config.camera, CAMERAS[config.camera]
    camera = RealSense(wanted, partial(device_frames, wanted, config.serial))
    words = f"The {name} camera is on {config.dds}. Ctrl-C ends its driver."
    _drive(f"camera_{name}", config.dds, words, partial(CameraProcess, name=name, source=camera))


def _drive(name: str, dds: DdsConfig, words: str, make: Callable[[DriverPlace], DeviceProcess]) -> None:
    """Join the domain as `name`, say `words`, and run the process that `make` returns until Ctrl-C."""
    with interrupted() as stop, closing(AsyncLogger()) as tell, member(name, dds, tell) as (participant, node):
        process = make(DriverPlace(participant, node, tell=tell))
        tell(words)
        while not stop.wait(TICK):
            process.step()
