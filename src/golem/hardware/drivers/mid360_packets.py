"""The datagrams of the Livox MID-360: points and IMU, as its Ethernet protocol describes them.

Little endian. A header of 36 bytes, then the data:

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

import struct
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.types import Array

HEADER = struct.Struct("<BHHHHBBB12xIQ")
"""Version, length, interval, dots, datagram, frame, data type, time type, checksum, time."""
CHECKED = 28
"""From where on the checksum counts."""
IMU_DATA, POINT_DATA = 0, 1
POINT = np.dtype(
    {"names": ["xyz", "reflectivity", "tag"], "formats": ["(3,)<i4", "u1", "u1"], "itemsize": 14}
)
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
        firings: how many there were.
        points: (n, 3) float32 in the LiDAR's axes [m].
        offsets: (n,) float32 time of each after the first firing [s], ascending.
    """

    t: int
    span: float
    firings: int
    points: NDArray[np.float32]
    offsets: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class ImuDatagram:
    """One sample of the IMU inside.

    Attributes:
        t: device time [ns].
        gyro: (3,) [rad/s].
        acc: (3,) specific force [m/s^2].
    """

    t: int
    gyro: Array
    acc: Array


def decode_datagram(data: bytes) -> PointDatagram | ImuDatagram:
    """Return what a datagram says.

    Raises:
        ValueError: it is none of these two, or damaged.
    """
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
    return PointDatagram(t, span, dots, raw[hit].astype(np.float32) * np.float32(1e-3), offsets)
