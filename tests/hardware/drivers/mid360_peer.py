"""A MID-360 that sends datagrams, written from the description of its protocol a second time. Time is simulated."""

from __future__ import annotations

import socket
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

POINTS = 96
SPAN = 4750
"""From the first to the last point of a datagram [0.1 us]."""
PERIOD = 480_000
"""From one datagram to the next [ns]."""


def datagram(kind: int, dots: int, t: int, body: bytes, interval: int = 0, count: int = 0) -> bytes:
    """Return a datagram; `t` [ns]."""
    checked = struct.pack("<Q", t) + body
    head = struct.pack("<BHHHHBBB", 0, 36 + len(body), interval, dots, count & 0xFFFF, 0, kind, 0)
    return head + bytes(12) + struct.pack("<I", zlib.crc32(checked)) + checked


def points_datagram(t: int, millimetres: NDArray[np.int32], count: int = 0) -> bytes:
    """Return the datagram of (n, 3) points [mm]; one that is 0, 0, 0 hit nothing."""
    rows = b"".join(struct.pack("<iiiBB", *map(int, row), 40, 0) for row in millimetres)
    return datagram(1, len(millimetres), t, rows, SPAN, count)


def imu_datagram(t: int, gyro: tuple[float, ...], acc: tuple[float, ...]) -> bytes:
    """Return the datagram of a sample [rad/s, g]."""
    return datagram(0, 1, t, struct.pack("<6f", *gyro, *acc))


class Mid360Peer:
    """Sends points of a room and the IMU at rest to the ports of a host."""

    def __init__(self, ports: tuple[int, int], start: int = 5_000_000_000) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self._ports = [("127.0.0.1", port) for port in ports]
        self.t = self._imu_due = start
        self.count = self.sent = 0
        rng = np.random.default_rng(0)
        self._rooms = [rng.integers(-9000, 9000, (POINTS, 3), dtype=np.int32) for _ in range(8)]
        self._bodies = [points_datagram(0, room)[36:] for room in self._rooms]

    def run(self, datagrams: int, drop: frozenset[int] = frozenset()) -> None:
        """Send so many datagrams of points, except those whose count is in `drop`, and the IMU's beside them."""
        for _ in range(datagrams):
            body = self._bodies[self.count % 8]
            if self.count not in drop:
                self.send(0, datagram(1, POINTS, self.t, body, SPAN, self.count))
                self.sent += POINTS
            self.count += 1
            self.t += PERIOD
            if self.t >= self._imu_due:
                self.send(1, imu_datagram(self._imu_due, (0.01, -0.02, 0.03), (0.0, 0.0, 1.0)))
                self._imu_due += 5_000_000

    def send(self, port: int, data: bytes) -> None:
        """Send anything to the port of points (0) or of the IMU (1)."""
        self._socket.sendto(data, self._ports[port])

    def close(self) -> None:
        """Send no more."""
        self._socket.close()
