"""The LiDAR is calibrated after the head, by what both see."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.sensors.calibration import Calibration, LidarMount, read_calibration
from golem.robots.sensors.mid360 import draw_mount
from golem.runtime.calibrate_command import CalibrateConfig, run_calibrate
from golem.runtime.lockstep import build
from golem.skills.calibrate_lidar import CalibrateLidar, CalibrateLidarGoal
from golem.stack import load_stack


def a_head(file: Path) -> None:
    Calibration({"head": np.eye(4)}, {"head": 1e-6 * np.eye(6)}).save(file)


@pytest.mark.parametrize("wrong", [{"views": 0}, {"settle": -1.0}, {"turn": 2.0}, {"file": ""}, {"file": "../x.json"}])
def test_a_goal_without_sense_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        CalibrateLidarGoal(**wrong)  # type: ignore[arg-type]


def test_more_views_get_more_time() -> None:
    few, many = CalibrateLidarGoal(views=3), CalibrateLidarGoal(views=9)
    assert CalibrateLidar().timeout(many) > CalibrateLidar().timeout(few) > 60.0


def test_the_head_comes_first(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="golem calibrate head --file .* comes first"):
        run_calibrate(CalibrateConfig("lidar", file=str(tmp_path / "calibration.json")))
    Calibration().save(tmp_path / "calibration.json")
    running, _ = build(load_stack("tether").with_skill("calibrate_lidar", folder=str(tmp_path)), 0)
    result = running.execute("calibrate_lidar", {})
    assert not result.success and "has no head camera" in result.reason


def test_a_stack_that_does_not_hear_the_lidar_says_so(tmp_path: Path) -> None:
    a_head(tmp_path / "calibration.json")
    stack = load_stack("tether").with_skill("calibrate_lidar", folder=str(tmp_path))
    running, _ = build(stack, 0)
    result = running.execute("calibrate_lidar", {"views": 1, "settle": 0.0})
    assert (result.success, result.stage, result.slot) == (False, "look", "robot")
    assert "odometry: {use: lio}" in result.reason


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_robot_finds_where_its_lidar_sits(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    a_head(file)
    assert run_calibrate(CalibrateConfig("lidar", seed=3, file=str(file)))
    found, true = read_calibration(file), draw_mount("field", 3)
    assert found.lidar is not None and set(found.cameras) == {"head"}
    left = LidarMount(np.linalg.inv(true) @ found.lidar.pose, found.lidar.covariance)
    assert left.moved(3.0) < 0.010 < 0.020 < LidarMount(true, np.zeros((6, 6))).moved(3.0)
