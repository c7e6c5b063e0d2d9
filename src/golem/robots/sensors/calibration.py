"""Where each camera sits, by calibration: a transform from where the robot's model has it."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from golem.errors import ConfigError
from golem.interfaces import public
from golem.interfaces import ros_convert as convert
from golem.interfaces.lidar import LidarImu, LidarScan
from golem.middleware.ros.msgs.tf2_msgs import TFMessage
from golem.output_file import write_file
from golem.robots.model.spatial import skew
from golem.robots.model.table import JOINT_INDEX, JOINT_NAMES
from golem.types import NUM_JOINTS, SIDES, Array


class LidarCorrection:
    """Corrects scans and IMU samples by a calibrated mount.

    Everything behind it may take the sensor for where the model has it. The place of the IMU in the sensor is left
    alone: a mount that is off by millimetres moves it by no more.
    """

    def __init__(self, pose: Array | None) -> None:
        """Correct by the (4, 4) pose of lidar_link in the nominal one; None corrects nothing."""
        self._R = None if pose is None else pose[:3, :3].astype(np.float32)
        self._p = None if pose is None else pose[:3, 3].astype(np.float32)

    def scan(self, scan: LidarScan) -> LidarScan:
        """Return `scan` with its points in the nominal lidar_link."""
        if self._R is None or self._p is None:
            return scan
        return replace(scan, points=scan.points @ self._R.T + self._p)

    def imu(self, sample: LidarImu) -> LidarImu:
        """Return `sample` in the axes of the nominal lidar_link."""
        if self._R is None:
            return sample
        return replace(sample, gyro=self._R @ sample.gyro, acc=self._R @ sample.acc)


OPTICAL_FRAMES = {"head": "head_camera_optical"} | {f"{s}_hand": f"{s}_hand_camera_optical" for s in SIDES}
"""Frame of the nominal model per camera."""


def calibrations(message: TFMessage) -> dict[str, Array]:
    """Return the (4, 4) pose of each optical frame in its nominal one, by camera, as far as `message` has it.

    The drivers of the cameras publish frames of the same names, in other parents.
    """
    wanted = {(OPTICAL_FRAMES[camera], public.optical_frame(camera)): camera for camera in OPTICAL_FRAMES}
    links = ((wanted.get((link.header.frame_id, link.child_frame_id)), link) for link in message.transforms)
    return {camera: convert.transform_matrix(link.transform) for camera, link in links if camera is not None}


FARTHEST = 0.3
"""By how much the mount of a sensor can move what is 1 m away [m]: more is no mount's error."""


def _none() -> Array:
    return np.zeros(NUM_JOINTS)


@dataclass(frozen=True, slots=True)
class LidarMount:
    """Where the LiDAR sits.

    Attributes:
        pose: (4, 4) pose of lidar_link in that of the nominal model.
        covariance: (6, 6) of that pose: rotation vector [rad], translation [m].
    """

    pose: Array
    covariance: Array

    def moved(self, away: float) -> float:
        """Return by how much the mount moves points `away` from the sensor [m], RMS over all directions [m]."""
        turn = 3.0 - float(np.trace(self.pose[:3, :3]))
        return math.sqrt(turn * 2.0 / 3.0 * away**2 + float(self.pose[:3, 3] @ self.pose[:3, 3]))

    def moved_sigma(self, away: float) -> float:
        """Return the standard deviation of those points [m]."""
        turn, place = (float(np.trace(part)) for part in (self.covariance[:3, :3], self.covariance[3:, 3:]))
        return math.sqrt(turn * 2.0 / 3.0 * away**2 + place)


def point_moved(T: Array, ahead: float) -> float:
    """Return by how much the pose `T` (4, 4) moves the point `ahead` [m] on the z axis [m]."""
    point = np.array([0.0, 0.0, ahead])
    return float(np.linalg.norm(T[:3, :3] @ point + T[:3, 3] - point))


@dataclass(frozen=True, slots=True)
class Calibration:
    """Where cameras and LiDAR sit and where encoders count from.

    Attributes:
        cameras: by camera, the (4, 4) pose of its optical frame in that of the nominal model.
        covariances: by camera, the (6, 6) covariance of that pose: rotation vector [rad], translation [m].
        joint_offset: (27,) reported minus true joint position [rad].
        joint_sigma: (27,) standard deviation of that [rad]; 0 where it was not looked for.
        residual: what is left of the corners' errors, root mean square [px].
        views: how many it was found from.
        lidar: where the LiDAR sits; None where it was not looked for.
    """

    cameras: dict[str, Array] = field(default_factory=dict[str, Array])
    covariances: dict[str, Array] = field(default_factory=dict[str, Array])
    joint_offset: Array = field(default_factory=_none)
    joint_sigma: Array = field(default_factory=_none)
    residual: float = 0.0
    views: int = 0
    lidar: LidarMount | None = None

    @property
    def mount(self) -> Array | None:
        """(4, 4) pose of lidar_link in that of the nominal model; None where it was not looked for."""
        return None if self.lidar is None else self.lidar.pose

    def merged(self, cameras: Mapping[str, Array]) -> dict[str, Array]:
        """Return `cameras`, poses as above, with those that were calibrated in the place of theirs."""
        return {name: self.cameras.get(name, T) for name, T in cameras.items()}

    def moved(self, camera: str, ahead: float) -> float:
        """Return by how much the mount of `camera` moves the point `ahead` [m] on its optical axis [m]."""
        return point_moved(self.cameras[camera], ahead)

    def moved_sigma(self, camera: str, ahead: float) -> float:
        """Return the standard deviation of that point, the largest of its axes [m]."""
        J = np.hstack([skew(np.array([0.0, 0.0, -ahead])), np.eye(3)])
        return math.sqrt(float(np.linalg.eigvalsh(J @ self.covariances[camera] @ J.T).max()))

    def save(self, path: Path) -> None:
        """Write it. Raises OutputError: it cannot be written."""
        rows: dict[str, Any] = {
            "cameras": {
                name: {"pose": T.tolist(), "covariance": self.covariances[name].tolist()}
                for name, T in self.cameras.items()
            },
            "joints": {
                name: {"offset": float(self.joint_offset[i]), "sigma": float(self.joint_sigma[i])}
                for i, name in enumerate(JOINT_NAMES)
                if self.joint_sigma[i] > 0.0
            },
            "residual": self.residual,
            "views": self.views,
        }
        if self.lidar is not None:
            rows["lidar"] = {"pose": self.lidar.pose.tolist(), "covariance": self.lidar.covariance.tolist()}
        write_file(path, json.dumps(rows, indent=1) + "\n")


def read_calibration(path: Path) -> Calibration:
    """Read what `Calibration.save` wrote. Raises ConfigError: it cannot be read, or is none."""
    try:
        rows: Any = json.loads(path.read_text(encoding="utf-8"))
        cameras = {name: np.array(row["pose"], float) for name, row in rows["cameras"].items()}
        covariances = {name: np.array(row["covariance"], float) for name, row in rows["cameras"].items()}
        offset, sigma = _none(), _none()
        for name, row in rows["joints"].items():
            offset[JOINT_INDEX[name]], sigma[JOINT_INDEX[name]] = row["offset"], row["sigma"]
        row = rows.get("lidar")
        lidar = None
        if row is not None:
            lidar = LidarMount(np.array(row["pose"], float), np.array(row["covariance"], float))
        found = Calibration(cameras, covariances, offset, sigma, float(rows["residual"]), int(rows["views"]), lidar)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"'{path}' is no calibration: {error!r}; golem calibrate head writes one.") from error
    unknown = [name for name in cameras if name not in OPTICAL_FRAMES]
    if unknown:
        raise ConfigError(
            f"'{path}' is no calibration: it has the camera {unknown[0]}; valid: {', '.join(OPTICAL_FRAMES)}."
        )
    mounts = [(f"the camera {name}", T, covariances[name]) for name, T in cameras.items()]
    mounts += [] if lidar is None else [("the LiDAR", lidar.pose, lidar.covariance)]
    for what, T, covariance in mounts:
        if wrong := _wrong(T, covariance):
            raise ConfigError(f"'{path}' is no calibration: {what} {wrong}.")
    if not np.isfinite(offset).all() or np.abs(offset).max() > 0.3:
        raise ConfigError(f"'{path}' shifts a joint by more than 0.3 rad: that is no encoder's zero.")
    return found


def _wrong(T: Array, covariance: Array) -> str:
    """Return what is wrong with the pose of a mount (4, 4) and its covariance (6, 6); empty where nothing is."""
    if T.shape != (4, 4) or not np.isfinite(T).all() or not np.array_equal(T[3], [0.0, 0.0, 0.0, 1.0]):
        return "has no (4, 4) pose of finite numbers"
    R, away = T[:3, :3], float(np.linalg.norm(T[:3, 3]))
    if not np.allclose(R @ R.T, np.eye(3), atol=1e-4):
        return "has no rotation: its axes are not square and of length 1"
    if np.linalg.det(R) < 0.0:
        return "is mirrored: its axes are left-handed"
    if away > FARTHEST:
        return f"is {away:g} m off its place; no mount is more than {FARTHEST:g} m off, so these may be millimetres"
    if math.sqrt((3.0 - np.trace(R)) * 2.0 / 3.0 + away**2) > FARTHEST:
        return f"moves what is 1 m away by more than {FARTHEST:g} m"
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        return "has no (6, 6) covariance of finite numbers"
    return ""


@dataclass(frozen=True)
class CalibrationPart:
    """The calibration that a stack uses.

    Attributes:
        file: what `golem calibrate` wrote; without one cameras are where the robot says, and encoders are believed.
    """

    file: Path | None = None

    def load(self) -> Calibration:
        """Return it. Raises ConfigError: the file cannot be read, or is no calibration."""
        return Calibration() if self.file is None else read_calibration(self.file)
