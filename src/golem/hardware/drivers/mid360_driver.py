"""Driver of the Livox MID-360: listens to its datagrams, and delivers what the twin's LiDAR delivers."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import numpy as np

from golem.errors import GolemError
from golem.hardware.drivers.device_clock import DeviceClock
from golem.hardware.drivers.mid360_packets import ImuDatagram, PointDatagram, decode_datagram
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.robots.sensors.mid360 import POINT_RATE, SCAN

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
    """Puts the points of datagrams together to scans of 0.1 s.

    Attributes:
        lost: firings that are missing between datagrams.
    """

    def __init__(self) -> None:
        """Start before the first datagram."""
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
        return LidarScan(
            1e-9 * (self._begin + SCAN_NS), points[order], np.minimum(offsets[order], SCAN), SCAN
        )


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
    except OSError as error:
        listening.close()
        raise LidarError(
            f"Nobody can listen to the LiDAR at {host}, port {port}: {error.strerror}."
        ) from error
    return listening
