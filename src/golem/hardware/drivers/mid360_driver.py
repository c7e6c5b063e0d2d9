"""Driver of the Livox MID-360: listens to its datagrams, and delivers what the twin's LiDAR delivers.

Datagrams of points and of the IMU, as the Ethernet protocol of the MID-360 describes them: little endian, a header of
36 bytes, then the data:

    0  version       u8, 0                               10 data type   u8: 0 IMU, 1 points of 32 bits
    1  length        u16, of the whole datagram          11 time type   u8
    3  interval      u16, first to last point, 0.1 us    12 reserved    12 bytes
    5  dots          u16, points or samples              24 checksum    u32, CRC-32 of all that follows
    7  datagram      u16, counts up                      28 time        u64, of the first point [ns]
    9  frame         u8                                  36 data

A point is x, y, z [mm], i32 each, then reflectivity and tag, u8 each. A sample is gyro [rad/s] and specific force [g],
six f32.
Source: Livox wiki, "Livox LiDAR communication protocol, Mid-360".
"""

from __future__ import annotations

import socket
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.errors import GolemError
from golem.hardware.drivers.device_clock import DeviceClock
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.robots.sensors.mid360 import POINT_RATE, SCAN
from golem.types import Array

HEADER = struct.Struct("<BHHHHBBB12xIQ")
"""Version, length, interval, dots, datagram, frame, data type, time type, checksum, time."""
CHECKED = 28
"""From where on the checksum counts."""
IMU_DATA, POINT_DATA = 0, 1
POINT = np.dtype({"names": ["xyz", "reflectivity", "tag"], "formats": ["(3,)<i4", "u1", "u1"], "itemsize": 14})
SAMPLE_SIZE = 24
MAX_POINTS = 100
"""Points of a datagram at most; the device sends 96."""
GRAVITY = 9.80665
"""One g [m/s^2]."""


@dataclass(frozen=True, slots=True)
class PointDatagram:
    """The points of one datagram, without those that hit nothing.

    Attributes:
        t: device time of the first firing [ns].
        span: time from the first firing to the last [s].
        points: (n, 3) float32 in the LiDAR's axes [m].
        offsets: (n,) float32 time of each after the first firing [s], ascending.
    """

    t: int
    span: float
    points: NDArray[np.float32]
    offsets: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class ImuDatagram:
    """One sample of the IMU inside: device time `t` [ns], `gyro` (3,) [rad/s], specific force `acc` (3,) [m/s^2]."""

    t: int
    gyro: Array
    acc: Array


def decode_datagram(data: bytes) -> PointDatagram | ImuDatagram:
    """Return what a datagram says. Raises ValueError: it is none of these two, or damaged."""
    if len(data) < HEADER.size:
        raise ValueError(f"{len(data)} bytes are no datagram of a MID-360")
    version, length, interval, dots, _, _, kind, _, checksum, t = HEADER.unpack_from(data)
    if version != 0 or length != len(data):
        raise ValueError(f"version {version}, {length} bytes announced, {len(data)} came")
    # A device that does not fill the field in sends 0.
    if checksum and checksum != zlib.crc32(memoryview(data)[CHECKED:]):
        raise ValueError("the checksum is wrong")
    body = len(data) - HEADER.size
    if kind == POINT_DATA and 1 <= dots <= MAX_POINTS and body == dots * POINT.itemsize:
        return _points(data, t, 1e-7 * interval, dots)
    if kind == IMU_DATA and dots == 1 and body == SAMPLE_SIZE:
        values = np.frombuffer(data, "<f4", 6, HEADER.size).astype(np.float64)
        if not np.isfinite(values).all():
            raise ValueError("a sample of the IMU is no number")
        return ImuDatagram(t, values[:3], GRAVITY * values[3:])
    raise ValueError(f"data type {kind} with {dots} dots in {body} bytes")


def _points(data: bytes, t: int, span: float, dots: int) -> PointDatagram:
    raw = np.frombuffer(data, POINT, dots, HEADER.size)["xyz"]
    hit = raw.any(axis=1)
    step = span / (dots - 1) if dots > 1 else 0.0
    offsets = (step * np.flatnonzero(hit)).astype(np.float32)
    return PointDatagram(t, span, raw[hit].astype(np.float32) * np.float32(1e-3), offsets)


POINT_PORT, IMU_PORT = 56301, 56401
"""Ports of the host to which the device sends, unless it was told others."""
MAX_DATAGRAM = 2048
"""Bytes of a datagram at most."""
BUFFER = 4 * 2**20
"""What the operating system is asked to keep for us [bytes]: more than a second of points."""
AT_ONCE = 2000
"""Datagrams that one step takes at most: a second of points."""
SCAN_NS = round(SCAN * 1e9)


class LidarError(GolemError):
    """The LiDAR's ports cannot be opened."""


class ScanAssembler:
    """Puts the points of datagrams together to scans of 0.1 s; `lost` counts the firings that are missing."""

    def __init__(self) -> None:
        self.lost = 0
        self._begin = self._next = 0
        self._parts: list[PointDatagram] = []

    def add(self, datagram: PointDatagram) -> LidarScan | None:
        """Take in a datagram; return the scan that ended before it, in the device's time, if one did."""
        finished = None
        if self._parts and not 0 <= datagram.t - self._begin < SCAN_NS:
            finished = self._finish()
        if not self._parts:
            going_on = SCAN_NS <= datagram.t - self._begin < 2 * SCAN_NS and self._next > 0
            self._begin = self._begin + SCAN_NS if going_on else datagram.t
        self._count(datagram)
        self._parts.append(datagram)
        return finished

    def _count(self, datagram: PointDatagram) -> None:
        step = 1e9 / POINT_RATE
        gap = datagram.t - self._next
        if self._parts and 0.5 * step < gap < SCAN_NS:
            self.lost += round(gap / step)
        self._next = datagram.t + round(1e9 * datagram.span + step)

    def _finish(self) -> LidarScan:
        parts, self._parts = self._parts, []
        points = np.concatenate([part.points for part in parts])
        offsets = np.concatenate([part.offsets + np.float32(1e-9 * (part.t - self._begin)) for part in parts])
        order = np.argsort(offsets, kind="stable")
        return LidarScan(1e-9 * (self._begin + SCAN_NS), points[order], np.minimum(offsets[order], SCAN), SCAN)


class Mid360:
    """One MID-360. Never waits: it has to be stepped at least ten times a second.

    Attributes:
        malformed: datagrams that are none of the device's, or damaged.
        foreign: datagrams of another sender.
    """

    def __init__(
        self, host: str, device: str | None = None, point_port: int = POINT_PORT, imu_port: int = IMU_PORT
    ) -> None:
        """Listen.

        Args:
            host: our address on the device's network, to which it was told to send.
            device: address of the device; None takes the first one that is heard.
            point_port: our port for points.
            imu_port: our port for the IMU.

        Raises:
            LidarError: a port cannot be opened.
        """
        self.malformed = self.foreign = 0
        self._device = device
        self._sockets = [_listen(host, port) for port in (point_port, imu_port)]
        self._assembler, self._clock = ScanAssembler(), DeviceClock()
        self._newest: dict[type, int] = {}

    @property
    def lost(self) -> int:
        """Firings that are missing between datagrams."""
        return self._assembler.lost

    @property
    def ports(self) -> tuple[int, int]:
        """Our ports for points and IMU."""
        points, imu = (listening.getsockname()[1] for listening in self._sockets)
        return points, imu

    def step(self, t: float) -> list[LidarScan | LidarImu]:
        """Take what has come by `t` [s], the robot's time; return scans and samples in that time, in their order."""
        found: list[LidarScan | LidarImu] = []
        for listening in self._sockets:
            for data in self._received(listening):
                try:
                    datagram = decode_datagram(data)
                except ValueError:
                    self.malformed += 1
                    continue
                found += self._take(datagram, t)
        return sorted(found, key=lambda measured: measured.t)

    def close(self) -> None:
        """Listen no more."""
        for listening in self._sockets:
            listening.close()

    def _received(self, listening: socket.socket) -> Iterator[bytes]:
        for _ in range(AT_ONCE):
            try:
                data, (address, _) = listening.recvfrom(MAX_DATAGRAM)
            except BlockingIOError:
                return
            if self._device is None:
                self._device = address
            if address == self._device:
                yield data
            else:
                self.foreign += 1

    def _take(self, datagram: PointDatagram | ImuDatagram, t: float) -> Iterator[LidarScan | LidarImu]:
        kind = type(datagram)
        if datagram.t < self._newest.get(kind, 0) - SCAN_NS:  # the device was started again
            self._clock.reset()
            self._assembler, self._newest = ScanAssembler(), {}
        self._newest[kind] = datagram.t
        seconds = 1e-9 * datagram.t
        if isinstance(datagram, ImuDatagram):
            self._clock.add(seconds, t)
            yield LidarImu(self._clock.ours(seconds), datagram.gyro, datagram.acc)
            return
        self._clock.add(seconds + datagram.span, t)
        scan = self._assembler.add(datagram)
        if scan is not None:
            yield LidarScan(self._clock.ours(scan.t), scan.points, scan.offsets, scan.duration)


def _listen(host: str, port: int) -> socket.socket:
    listening = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        listening.setblocking(False)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        listening.bind((host, port))
    except (OSError, OverflowError) as error:
        listening.close()
        why = error.strerror if isinstance(error, OSError) else "a port is 1 to 65535"
        text = f"Nobody can listen to the LiDAR at {host}, port {port}: {why}."
        raise LidarError(f"{text} Give an address of this machine, in the LiDAR's network.") from error
    return listening
