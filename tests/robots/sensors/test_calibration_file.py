"""A calibration comes back from its file as it was; what is none is refused in a sentence."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.calibration.kinematic_fit import pose
from golem.errors import ConfigError
from golem.robots.sensors.calibration import Calibration, CalibrationPart, LidarMount, read_calibration
from golem.types import NUM_JOINTS


def example() -> Calibration:
    offset, sigma = np.zeros(NUM_JOINTS), np.zeros(NUM_JOINTS)
    offset[13:], sigma[13:] = 0.02, 0.001
    T = np.eye(4)
    T[:3, 3] = (0.01, 0.02, 0.03)
    return Calibration({"head": T}, {"head": 1e-6 * np.eye(6)}, offset, sigma, 0.4, 24)


def test_it_comes_back_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "calibration.json"
    example().save(path)
    back = read_calibration(path)
    for name in ("joint_offset", "joint_sigma"):
        assert (getattr(back, name) == getattr(example(), name)).all()
    assert (back.cameras["head"] == example().cameras["head"]).all()
    assert (back.covariances["head"] == example().covariances["head"]).all()
    assert (back.residual, back.views) == (0.4, 24)


def test_only_what_was_calibrated_is_replaced() -> None:
    cameras = {"head": 2.0 * np.eye(4), "left_hand": 3.0 * np.eye(4)}
    merged = example().merged(cameras)
    assert (merged["head"] == example().cameras["head"]).all()
    assert (merged["left_hand"] == cameras["left_hand"]).all()
    assert CalibrationPart().load().merged(cameras) == cameras


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"cameras": {"head": 1}}'])
def test_what_is_none_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "none.json"
    path.write_text(text)
    with pytest.raises(ConfigError, match="golem calibrate head writes one"):
        CalibrationPart(path).load()


def test_a_zero_that_cannot_be_one_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wild.json"
    wild = example()
    replace(wild, joint_offset=wild.joint_offset + 0.5).save(path)
    with pytest.raises(ConfigError, match="no encoder's zero"):
        read_calibration(path)
    rows = json.loads(path.read_text())
    rows["cameras"] = {"nose": rows["cameras"]["head"]}
    path.write_text(json.dumps(rows))
    with pytest.raises(ConfigError, match="it has the camera nose; valid: head"):
        read_calibration(path)


def test_a_lidar_comes_back_and_a_wild_one_is_refused(tmp_path: Path) -> None:
    path, mount = tmp_path / "lidar.json", LidarMount(pose(np.full(6, 0.01)), 1e-6 * np.eye(6))
    replace(example(), lidar=mount).save(path)
    back = read_calibration(path).lidar
    assert back is not None and (back.pose == mount.pose).all() and (back.covariance == mount.covariance).all()
    replace(example(), lidar=replace(mount, pose=pose(np.full(6, 0.5)))).save(path)
    with pytest.raises(ConfigError, match="the LiDAR is 0.866025 m off its place"):
        read_calibration(path)


def turned(angle: float) -> np.ndarray:
    return pose(np.array([0.0, 0.0, angle, 0.0, 0.0, 0.0]))


def shifted(x: float) -> np.ndarray:
    T = np.eye(4)
    T[0, 3] = x
    return T


@pytest.mark.parametrize("what", ["camera", "LiDAR"])
@pytest.mark.parametrize(
    ("T", "said"),
    [
        (shifted(12.0), "12 m off its place; .* may be millimetres"),
        (shifted(-0.4), "0.4 m off its place"),
        (np.diag([1.0, -1.0, 1.0, 1.0]), "is mirrored"),
        (np.diag([-1.0, -1.0, -1.0, 1.0]), "is mirrored"),
        (np.diag([1.0, 1.0, 2.0, 1.0]), "has no rotation"),
        (np.diag([1000.0, 1000.0, 1000.0, 1.0]), "has no rotation"),
        (np.zeros((4, 4)), "has no .4, 4. pose"),
        (np.eye(3), "has no .4, 4. pose"),
        (shifted(np.nan), "has no .4, 4. pose"),
        (turned(1.0), "moves what is 1 m away by more than 0.3 m"),
        (np.diag([1.0, -1.0, -1.0, 1.0]), "moves what is 1 m away"),
    ],
)
def test_a_mount_that_cannot_be_one_is_refused(what: str, T: np.ndarray, said: str, tmp_path: Path) -> None:
    one = example()
    if what == "camera":
        one = replace(one, cameras={"head": T})
    else:
        one = replace(one, lidar=LidarMount(T, 1e-6 * np.eye(6)))
    one.save(tmp_path / "c.json")
    with pytest.raises(ConfigError, match=f"the {what}.* {said}"):
        read_calibration(tmp_path / "c.json")


def test_how_far_a_lidar_moves_what_it_sees_is_that_of_random_directions() -> None:
    rng = np.random.default_rng(0)
    x = np.array([0.010, -0.004, 0.020, 0.003, 0.006, -0.002])
    along = rng.standard_normal((200_000, 3))
    points = 3.0 * along / np.linalg.norm(along, axis=1)[:, None]
    T = pose(x)
    moved = np.sqrt((((points @ T[:3, :3].T + T[:3, 3]) - points) ** 2).sum(axis=1).mean())
    assert LidarMount(T, np.zeros((6, 6))).moved(3.0) == pytest.approx(moved, rel=0.01)
    sigma = LidarMount(np.eye(4), np.diag(x**2)).moved_sigma(3.0)
    drawn = x * rng.standard_normal((200_000, 6))
    error = np.cross(drawn[:, :3], points) + drawn[:, 3:]
    assert sigma == pytest.approx(np.sqrt((error**2).sum(axis=1).mean()), rel=0.01)
