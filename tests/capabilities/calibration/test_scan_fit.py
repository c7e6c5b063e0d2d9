"""The mount of the LiDAR is found again from surfaces that the head camera sees, within what the covariance says."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.calibration.kinematic_fit import pose
from golem.capabilities.calibration.scan_fit import T_TORSO_LIDAR, WINDOW, SurfaceView, fit_lidar, planes_of
from golem.errors import ConfigError
from golem.robots.model.spatial import rotation_rpy, transform
from golem.robots.model.table import T_TORSO_HEAD_OPTICAL
from golem.robots.sensors.cameras import HEAD, rays
from golem.robots.sensors.depth import STEREO
from golem.types import Array

FLOOR = (np.array([0.0, 0.0, 1.0]), -1.0)
WALLS = ((np.array([-1.0, 0.0, 0.0]), -1.1), (np.array([0.0, -1.0, 0.0]), -1.0), (np.array([0.0, 1.0, 0.0]), -1.0))
"""Normal and distance from the torso's frame, before it turns [m]."""
MOUNT = np.array([0.008, -0.009, 0.012, 0.004, -0.003, 0.005])


def ranges(origin: Array, along: Array, planes: tuple[tuple[Array, float], ...]) -> Array:
    """Return how far the nearest plane is along each of the (..., 3) directions."""
    far = np.full(along.shape[:-1], np.inf)
    for n, d in planes:
        with np.errstate(divide="ignore"):
            s = (d - origin @ n) / (along @ n)
        far = np.where(s > 0.0, np.minimum(far, s), far)
    return far


def view(angle: float, planes: tuple[tuple[Array, float], ...], rng: np.random.Generator) -> SurfaceView:
    """Return what a torso turned by `angle` [rad] sees, with the noise of both sensors."""
    T = transform((0.0, 0.0, 0.0), rotation_rpy(0.0, 0.0, angle))
    camera, lidar = T @ T_TORSO_HEAD_OPTICAL, T @ T_TORSO_LIDAR @ pose(MOUNT)
    depth = ranges(camera[:3, 3], rays(HEAD).astype(np.float64) @ camera[:3, :3].T, planes)
    fB = STEREO["head"].focal * STEREO["head"].baseline
    images = [
        np.where(depth < HEAD.far, fB / (fB / depth + 0.08 * rng.standard_normal(depth.shape)), 0.0) for _ in range(4)
    ]
    along = rng.standard_normal((60_000, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    along = along[(along[:, 2] > -0.12) & (along[:, 2] < 0.79)]
    s = ranges(lidar[:3, 3], along @ lidar[:3, :3].T, planes) + 0.02 * rng.standard_normal(len(along))
    return SurfaceView([i.astype(np.float32) for i in images], (s[:, None] * along).astype(np.float32))


def test_the_mount_is_found_within_what_the_covariance_says() -> None:
    rng = np.random.default_rng(0)
    views = [view(angle, (FLOOR, *WALLS), rng) for angle in (-0.8, 0.0, 0.8)]
    found = fit_lidar(views, HEAD, np.eye(4), np.zeros((6, 6)))
    change = np.linalg.solve(pose(MOUNT), found.mount.pose)
    error = np.array([change[2, 1], change[0, 2], change[1, 0], *change[:3, 3]])
    assert np.linalg.norm(error[:3]) < 0.002 and np.linalg.norm(error[3:]) < 0.003
    assert error @ np.linalg.solve(found.mount.covariance, error) < 25.0
    assert 0.018 < found.residual < 0.022


def test_the_head_cameras_error_counts() -> None:
    rng = np.random.default_rng(1)
    views = [view(angle, (FLOOR, *WALLS), rng) for angle in (-0.8, 0.0, 0.8)]
    # A camera that is believed off by 3 mrad takes the LiDAR with it; the covariance has to say so.
    turn = np.array([0.0, 0.003, 0.0, 0.0, 0.0, 0.0])
    found = fit_lidar(views, HEAD, pose(turn), 0.003**2 * np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))
    change = np.linalg.solve(pose(MOUNT), found.mount.pose)
    error = np.array([change[2, 1], change[0, 2], change[1, 0], *change[:3, 3]])
    assert 0.002 < np.linalg.norm(error[:3]) < 0.004
    assert error @ np.linalg.solve(found.mount.covariance, error) < 25.0


def test_a_floor_alone_does_not_fix_it() -> None:
    views = [view(angle, (FLOOR,), np.random.default_rng(2)) for angle in (-0.8, 0.8)]
    with pytest.raises(ConfigError, match="upright surfaces that face different ways"):
        fit_lidar(views, HEAD, np.eye(4), np.zeros((6, 6)))


def test_nothing_to_see_is_said() -> None:
    dark = SurfaceView([np.zeros((HEAD.height, HEAD.width), np.float32)], np.full((10, 3), np.nan, np.float32))
    with pytest.raises(ConfigError, match="saw 0 points of the same even surfaces"):
        fit_lidar([dark], HEAD, np.eye(4), np.zeros((6, 6)))


def test_planes_are_those_of_the_surfaces_and_none_crosses_an_edge() -> None:
    depth = np.full((HEAD.height, HEAD.width), 1.5, np.float32)
    depth[:, 320:] = 1.0
    N = planes_of([depth], HEAD)
    np.testing.assert_allclose(N[100, 100], [0.0, 0.0, 1.0 / 1.5], atol=1e-6)
    np.testing.assert_allclose(N[100, 500], [0.0, 0.0, 1.0], atol=1e-6)
    half = WINDOW // 2
    assert not N[:, 320 - half : 320 + half].any() and not N[0].any()
