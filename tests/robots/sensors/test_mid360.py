"""The pattern of the LiDAR has the published properties, and its errors are drawn from the seed."""

from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.sensors.mid360 import ELEVATION, POINT_RATE, SCAN, directions, draw_mount, lidar_errors


def cells(seconds: float, start: float = 0.0) -> set[tuple[int, int]]:
    """Return the cells of one degree that are looked at."""
    d = directions(start + np.arange(round(seconds * POINT_RATE)) / POINT_RATE)
    azimuth, elevation = np.arctan2(d[:, 1], d[:, 0]), np.arcsin(d[:, 2])
    return set(zip(np.floor(np.rad2deg(azimuth)).astype(int), np.floor(np.rad2deg(elevation)).astype(int), strict=True))


def test_it_looks_all_around_and_within_its_elevation() -> None:
    d = directions(np.arange(round(SCAN * POINT_RATE)) / POINT_RATE)
    assert len(d) == 20_000 and np.allclose(np.linalg.norm(d, axis=1), 1.0)
    elevation = np.arcsin(d[:, 2])
    assert elevation.min() >= ELEVATION[0] - 1e-9 and elevation.max() <= ELEVATION[1] + 1e-9
    assert np.ptp(elevation) > 0.99 * (ELEVATION[1] - ELEVATION[0])
    turn = np.sort(np.arctan2(d[:, 1], d[:, 0]))
    assert np.diff(turn).max() < np.deg2rad(1.0)


def test_it_does_not_repeat() -> None:
    first, second = cells(0.1), cells(0.1, 0.1)
    assert len(first & second) < 0.7 * len(first)
    assert len(cells(0.1)) < 0.8 * 360 * 59 and len(cells(1.0)) > 0.95 * 360 * 59


def test_the_mounting_error_is_the_seeds() -> None:
    assert np.array_equal(draw_mount("field", 3), draw_mount("field", 3))
    assert not np.array_equal(draw_mount("field", 3), draw_mount("field", 4))
    assert np.array_equal(draw_mount("ideal", 3), np.eye(4))


def test_an_unknown_profile_is_refused() -> None:
    with pytest.raises(ConfigError, match="'feild'.*field"):
        lidar_errors("feild")
