from __future__ import annotations

import random
import struct
import time
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.hardware.drivers.mid360_peer import PERIOD, POINTS, Mid360Peer, datagram, imu_datagram, points_datagram

from golem.hardware.drivers.device_clock import DeviceClock
from golem.hardware.drivers.mid360_driver import ImuDatagram, LidarError, Mid360, PointDatagram, decode_datagram
from golem.interfaces.lidar import LidarImu, LidarScan

OURS = 100.0
"""Our time when the device's shows 5 s."""


@pytest.fixture
def lidar() -> Iterator[Mid360]:
    lidar = Mid360("127.0.0.1", point_port=0, imu_port=0)
    yield lidar
    lidar.close()


@pytest.fixture
def peer(lidar: Mid360) -> Iterator[Mid360Peer]:
    peer = Mid360Peer(lidar.ports)
    yield peer
    peer.close()


def run(
    lidar: Mid360, peer: Mid360Peer, datagrams: int, drop: frozenset[int] = frozenset(), delay: float = 0.0
) -> tuple[list[LidarScan], list[LidarImu]]:
    """Let the device send, and the host look every 10 datagrams (4.8 ms)."""
    scans, samples = list[LidarScan](), list[LidarImu]()
    for _ in range(datagrams // 10):
        peer.run(10, drop)
        for found in lidar.step(OURS + 1e-9 * (peer.t - 5_000_000_000) + delay):
            (scans if isinstance(found, LidarScan) else samples).append(found)  # pyright: ignore[reportArgumentType]
    return scans, samples


def test_a_point_of_a_recorded_device_is_read() -> None:
    record = bytes.fromhex("05fcffff57f9ffffbe0900000400")  # as a capture of a MID-360 shows it
    found = decode_datagram(datagram(1, 1, 7, record))
    assert isinstance(found, PointDatagram)
    np.testing.assert_allclose(found.points, [[-1.019, -1.705, 2.494]], atol=1e-6)


def test_points_that_hit_nothing_are_left_out_and_the_others_keep_their_times() -> None:
    rows = np.arange(3 * POINTS, dtype=np.int32).reshape(POINTS, 3)
    rows[::2] = 0
    found = decode_datagram(points_datagram(123, rows))
    assert isinstance(found, PointDatagram)
    assert (found.t, len(found.points)) == (123, POINTS // 2)
    np.testing.assert_allclose(found.points, rows[1::2] * 1e-3, rtol=1e-6)
    np.testing.assert_allclose(found.offsets, np.arange(1, POINTS, 2) * 5e-6, rtol=1e-5)
    assert found.span == pytest.approx(475e-6)


def test_a_sample_of_the_imu_comes_in_si_units() -> None:
    found = decode_datagram(imu_datagram(9, (0.1, 0.2, 0.3), (0.0, -1.0, 0.5)))
    assert isinstance(found, ImuDatagram) and found.t == 9
    np.testing.assert_allclose(found.gyro, [0.1, 0.2, 0.3], rtol=1e-6)
    np.testing.assert_allclose(found.acc, [0.0, -9.80665, 4.903325], rtol=1e-6)


SOUND = (points_datagram(5, np.ones((POINTS, 3), np.int32)), imu_datagram(5, (0.0,) * 3, (0.0, 0.0, 1.0)))


@given(st.sampled_from(SOUND), st.data())
def test_a_damaged_datagram_is_refused(sound: bytes, data: st.DataObject) -> None:
    at = data.draw(st.one_of(st.sampled_from((0, 1, 2, 5, 6, 10)), st.integers(24, len(sound) - 1)))
    spoiled = bytearray(sound)
    spoiled[at] ^= 1 << data.draw(st.integers(0, 7))
    with pytest.raises(ValueError):
        decode_datagram(bytes(spoiled))
    with pytest.raises(ValueError):
        decode_datagram(sound[:at])


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ValueError, match="no number"):
        decode_datagram(datagram(0, 1, 0, struct.pack("<6f", float("nan"), 0, 0, 0, 0, 1)))


def test_a_hundred_thousand_malformed_datagrams_do_no_harm(lidar: Mid360, peer: Mid360Peer) -> None:
    rng = random.Random(3)
    for i in range(100_000):
        data = bytearray(SOUND[i % 2])
        if i % 3 == 0:
            data = rng.randbytes(rng.randrange(1400))
        elif i % 3 == 1:
            data[rng.choice((0, 1, 2, 5, 6, 10))] ^= 1 + rng.randrange(255)
        else:
            for at in rng.sample(range(24, len(data)), 1 + i % 3):
                data[at] ^= 1 + rng.randrange(255)
            del data[rng.randrange(1, 2 * len(data)) :]
        peer.send(i % 2, bytes(data))
        if i % 200 == 199:
            assert lidar.step(OURS) == []
    assert lidar.malformed == 100_000
    scans, samples = run(lidar, peer, 1000)
    assert len(scans) == 4 and len(samples) == 97 and lidar.lost == 0


def test_scans_hold_every_point_with_its_time(lidar: Mid360, peer: Mid360Peer) -> None:
    scans, samples = run(lidar, peer, 2100)
    assert len(scans) == 10 and lidar.lost == lidar.malformed == lidar.foreign == 0
    assert sum(len(scan.points) for scan in scans) == POINTS * -(-10 * 100_000_000 // PERIOD)
    for i, scan in enumerate(scans):
        assert scan.points.dtype == scan.offsets.dtype == np.float32
        assert (np.diff(scan.offsets) >= 0).all() and scan.offsets[-1] <= scan.duration < 0.1006
        assert scan.t - scan.duration == pytest.approx(OURS + 0.1 * i, abs=0.006)
    steps = np.diff([sample.t for sample in samples])
    assert steps == pytest.approx(0.005, abs=1e-5)
    assert samples[0].acc == pytest.approx([0.0, 0.0, 9.80665])


def test_lost_datagrams_are_counted_by_their_points(lidar: Mid360, peer: Mid360Peer) -> None:
    scans, _ = run(lidar, peer, 1000, drop=frozenset((7, 100, 101, 102, 555)))
    assert lidar.lost == 5 * POINTS and len(scans) == 4


def test_a_datagram_that_is_held_up_does_not_shift_the_clock(lidar: Mid360, peer: Mid360Peer) -> None:
    run(lidar, peer, 1000)
    scans, samples = run(lidar, peer, 500, delay=0.05)
    for sample in samples:
        assert sample.t <= OURS + 1e-9 * (peer.t - 5_000_000_000) + 1e-6
    assert scans[-1].t == pytest.approx(OURS + 0.7, abs=0.006)


def test_the_clock_follows_a_drift() -> None:
    clock = DeviceClock()
    for i in range(60_000):
        device = 0.005 * i
        clock.add(device, 20.0 + 1.0001 * device + (0.02 if i % 7 else 0.0))
    assert clock.ours(300.0) == pytest.approx(20.0 + 1.0001 * 300.0, abs=0.0012)


def test_a_device_that_was_started_again_begins_anew(lidar: Mid360, peer: Mid360Peer) -> None:
    run(lidar, peer, 1000)
    again = Mid360Peer(lidar.ports, start=1_000_000_000)
    t = OURS + 10.0
    scans = list[LidarScan]()
    for i in range(50):
        again.run(10)
        scans += [found for found in lidar.step(t + 0.0048 * (i + 1)) if isinstance(found, LidarScan)]
    again.close()
    assert [scan.t for scan in scans] == pytest.approx([t + 0.1, t + 0.2], abs=0.006)
    assert lidar.lost == 0


def test_another_sender_is_not_listened_to(lidar: Mid360, peer: Mid360Peer) -> None:
    lidar._device = "192.168.1.3"
    assert run(lidar, peer, 100) == ([], []) and lidar.foreign > 100 and lidar.malformed == 0


def test_a_port_that_is_taken_is_named(lidar: Mid360) -> None:
    with pytest.raises(LidarError, match=f"port {lidar.ports[0]}: Address already in use"):
        Mid360("127.0.0.1", point_port=lidar.ports[0], imu_port=0)


def test_a_port_that_is_none_is_named() -> None:
    with pytest.raises(LidarError, match="port 70000: a port is 1 to 65535"):
        Mid360("127.0.0.1", point_port=70000)


@pytest.mark.slow
def test_a_minute_of_points_loses_none_and_takes_a_quarter_of_a_core(lidar: Mid360, peer: Mid360Peer) -> None:
    used, scans, samples = 0.0, 0, 0
    for _ in range(60 * 1_000_000_000 // PERIOD // 10):
        peer.run(10)
        before = time.thread_time()
        found = lidar.step(OURS + 1e-9 * (peer.t - 5_000_000_000))
        used += time.thread_time() - before
        scans += sum(isinstance(measured, LidarScan) for measured in found)
        samples += sum(isinstance(measured, LidarImu) for measured in found)
    assert (scans, lidar.lost, lidar.malformed) == (599, 0, 0) and samples == pytest.approx(12_000, abs=2)
    assert used < 0.25 * 60.0, f"{used:.1f} s for 60 s of points"
