"""Fits the mount of the LiDAR to surfaces that a calibrated head camera sees, too.

Point to plane by projective association (Blais and Levine: "Registering multiview range data to create 3D computer
objects", PAMI 1995; Chen and Medioni: "Object modelling by registration of multiple range images", IVC 1992). Both
sensors hang from the torso, so no encoder and no motion of the robot plays a part while it rests. Inverse depth is
linear over the image of a plane, so a plane through the window around a pixel is a linear fit there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.capabilities.calibration.kinematic_fit import pose
from golem.errors import ConfigError
from golem.robots.model.spatial import skew
from golem.robots.model.table import FRAMES, T_TORSO_HEAD_OPTICAL
from golem.robots.sensors.calibration import LidarMount
from golem.robots.sensors.cameras import project
from golem.types import Array, CameraInfo

MOUNT = (0.03, 0.01)
"""Prior of the LiDAR's mount, rotation [rad] and translation [m], per axis."""
NOISE = 0.02
"""Noise of a range [m]."""
OVERCONFIDENCE = 10.0
"""By how much the variance is raised, because the errors of points on one surface are not independent."""
GATES = (0.15, 0.10, 0.06, 0.06, 0.06)
"""Errors of a range from which a point is none of the surface at its pixel [m], in one round after the other."""
WINDOW = 9
"""Width of the window that a plane is fitted to [px]; a wide one cuts more off the corners of a room."""
ROUGH = 0.006
"""Inverse depth by which a window may leave its plane, RMS [1/m]; noise of the mean of eight images is 0.002."""
STEEPEST = np.cos(np.deg2rad(75.0))
"""Cosine of the angle between ray and normal below which a surface is not used."""
NEAR = 0.35
"""Distance from the LiDAR within which a point may be the robot's [m]."""
POINTS = 2000
"""Fewest points on surfaces that make a fit."""
SURE = (0.0035, 0.006)
"""Standard deviations up to which the surfaces fix the mount, rotation [rad] and translation [m], along the worst axis.

A room gives 0.002 and 0.003. A floor alone gives 0.0048 and 0.0084, by the noise of its planes: it tells no heading."""
T_TORSO_LIDAR: Array = FRAMES["lidar_link"].T_parent_frame
"""(4, 4) nominal pose of lidar_link in torso_link."""


@dataclass(frozen=True, slots=True)
class SurfaceView:
    """What head camera and LiDAR saw of the same surroundings while the torso rested.

    Attributes:
        depth: (h, w) along the optical axis [m], of each image; 0 where there is none.
        points: (n, 3) of the scans, in lidar_link [m].
    """

    depth: Sequence[NDArray[np.float32]]
    points: NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class LidarFit:
    """What was found.

    Attributes:
        mount: where the LiDAR sits.
        residual: range of the points beyond the surfaces, root mean square [m].
        points: how many lay on surfaces.
    """

    mount: LidarMount
    residual: float
    points: int


def fit_lidar(views: Sequence[SurfaceView], info: CameraInfo, head: Array, head_covariance: Array) -> LidarFit:
    """Return the mount that brings the points of the scans onto the surfaces.

    Args:
        views: with the torso at different angles, or of surfaces that face different ways.
        head: (4, 4) pose of its optical frame in the nominal one, by its calibration.
        head_covariance: (6, 6) of that pose.

    Raises:
        ConfigError: the surfaces do not fix the mount.
    """
    planes = [planes_of(view.depth, info) for view in views]
    points = [_usable(view.points) for view in views]
    T_optical_lidar: Array = np.asarray(np.linalg.solve(T_TORSO_HEAD_OPTICAL @ head, T_TORSO_LIDAR), np.float64)
    x, prior = np.zeros(6), np.diag(np.repeat(MOUNT, 3) ** -2.0)
    told, residual, count = np.zeros((6, 6)), 0.0, 0
    for gate in GATES:
        rows = [_rows(T_optical_lidar, x, q, N, info, gate) for q, N in zip(points, planes, strict=True)]
        J, r = np.concatenate([a for a, _ in rows]), np.concatenate([b for _, b in rows])
        count = len(r)
        if count < POINTS:
            raise ConfigError(
                f"LiDAR and head camera saw {count} points of the same even surfaces; {POINTS} are the least: let the "
                "robot be where floor, walls and furniture are within 2 m of it."
            )
        # Tukey's weights: what one of the two does not see, or what moved, does not count.
        weighed = J * ((1.0 - (r / gate) ** 2) ** 2 / NOISE**2)[:, None]
        told = weighed.T @ J
        x -= np.linalg.solve(told + prior, weighed.T @ r + prior @ x)
        residual = float(np.sqrt(np.mean(r**2)))
    own = np.linalg.inv(told / OVERCONFIDENCE + prior)
    for what, part, unit, most in (("turn", own[:3, :3], "rad", SURE[0]), ("place", own[3:, 3:], "m", SURE[1])):
        sigma = float(np.sqrt(np.linalg.eigvalsh(part).max()))
        if sigma > most:
            raise ConfigError(
                f"What was seen fixes the {what} of the LiDAR only to {sigma:.3f} {unit}; {most:g} is asked for: let "
                "the robot be where it sees the floor and upright surfaces that face different ways."
            )
    return LidarFit(LidarMount(pose(x), own + _of_the_camera(T_optical_lidar, head_covariance)), residual, count)


def planes_of(depth: Sequence[NDArray[np.float32]], info: CameraInfo) -> Array:
    """Return the planes around the pixels of `depth` (h, w) [m], (h, w, 3): N with N . p = 1 [1/m], or 0."""
    stack = np.stack(depth).astype(np.float64)
    valid = stack > 0.0
    seen = valid.sum(axis=0)
    w = np.where(valid, 1.0 / np.where(valid, stack, 1.0), 0.0).sum(axis=0) / np.maximum(seen, 1)
    often: NDArray[np.uint8] = (2 * seen > len(stack)).astype(np.uint8)
    window = np.ones((WINDOW, WINDOW), np.uint8)
    whole = cv2.erode(often, window, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    u = (np.arange(info.width) - info.cx) / info.fx
    v = (np.arange(info.height) - info.cy) / info.fy
    X, Y = np.meshgrid(u, v)
    spread = (WINDOW**2 - 1) / 12.0
    mean = _mean(w)
    slope_x = (_mean(w * X) - mean * X) / (spread / info.fx**2)
    slope_y = (_mean(w * Y) - mean * Y) / (spread / info.fy**2)
    rough = _mean(w * w) - mean**2 - (slope_x / info.fx) ** 2 * spread - (slope_y / info.fy) ** 2 * spread
    N = np.dstack([slope_x, slope_y, mean - slope_x * X - slope_y * Y])
    length = np.linalg.norm(N, axis=2)
    ray = np.sqrt(1.0 + X * X + Y * Y)
    # N . ray is the inverse depth; over both lengths it is the cosine of the angle between them.
    good = whole & (rough < ROUGH**2) & (mean > STEEPEST * length * ray)
    return N * good[:, :, None]


def _mean(image: Array) -> Array:
    return np.asarray(cv2.blur(image, (WINDOW, WINDOW)), np.float64)


def _usable(points: NDArray[np.float32]) -> Array:
    """Return those of the (n, 3) points that are finite and not the robot's nearest parts."""
    sound = points[np.isfinite(points).all(axis=1)].astype(np.float64)
    return sound[(sound * sound).sum(axis=1) > NEAR**2]


def _rows(
    T_optical_lidar: Array, x: Array, points: Array, N: Array, info: CameraInfo, gate: float
) -> tuple[Array, Array]:
    """Return what each point says of the mount `x` (6,): (m, 6) derivatives and (m,) range beyond its surface [m].

    The derivatives are taken where the ray meets the surface: at the point itself they would share its noise.
    """
    along = points @ pose(x)[:3, :3].T
    R, p = T_optical_lidar[:3, :3], T_optical_lidar[:3, 3]
    origin = R @ x[3:] + p
    seen = along @ R.T + origin
    ahead = seen[:, 2] > info.near
    along, seen = along[ahead], seen[ahead]
    pixel = np.rint(project(info, seen)).astype(int)
    inside = ((pixel >= 0) & (pixel < (info.width, info.height))).all(axis=1)
    along, seen, pixel = along[inside], seen[inside], pixel[inside]
    plane = N[pixel[:, 1], pixel[:, 0]]
    length, distance = np.linalg.norm(plane, axis=1), np.linalg.norm(along, axis=1)
    towards = ((seen - origin) * plane).sum(axis=1)
    met = towards > STEEPEST * length * distance
    along, plane, distance, towards = along[met], plane[met], distance[met], towards[met]
    share = (1.0 - plane @ origin) / towards
    over = distance * (1.0 - share)
    near = np.abs(over) < gate
    normal: Array = (plane[near] @ R) * (distance[near] / towards[near])[:, None]
    lever: Array = np.cross(along[near] * share[near, None], normal).astype(np.float64)
    return np.hstack([lever, normal]), over[near]


def _of_the_camera(T_optical_lidar: Array, covariance: Array) -> Array:
    """Return the (6, 6) covariance of the LiDAR's mount that comes from that of the camera's, `covariance` (6, 6)."""
    R, p = T_optical_lidar[:3, :3], T_optical_lidar[:3, 3]
    J = np.zeros((6, 6))
    J[:3, :3] = J[3:, 3:] = R.T
    J[3:, :3] = -R.T @ skew(p)
    return J @ covariance @ J.T
