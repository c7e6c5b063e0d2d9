"""Palm cameras are calibrated after the head, by what the robot's own hands show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.sensors.calibration import read_calibration
from golem.runtime.calibrate_command import CalibrateConfig, run_calibrate
from golem.skills.calibrate_hands import CalibrateHands, CalibrateHandsGoal


@pytest.mark.parametrize("wrong", [{"views": 3}, {"settle": -1.0}, {"zero": 0.0}, {"zero": 1.0}])
def test_a_goal_without_sense_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        CalibrateHandsGoal(**wrong)  # type: ignore[arg-type]


def test_a_file_has_a_plain_name() -> None:
    with pytest.raises(ConfigError, match="cannot be the name"):
        CalibrateHandsGoal(file="../x.json")


def test_more_views_get_more_time() -> None:
    few, many = CalibrateHandsGoal(views=8), CalibrateHandsGoal(views=30)
    assert CalibrateHands().timeout(many) > CalibrateHands().timeout(few) > 60.0


def test_the_head_comes_first(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="golem calibrate head --file .* comes first"):
        run_calibrate(CalibrateConfig("hand", file=str(tmp_path / "calibration.json")))


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.timeout(1800)
def test_a_robot_finds_where_its_palm_cameras_sit(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    assert run_calibrate(CalibrateConfig("head", seed=3, file=str(file), views=10))
    assert run_calibrate(CalibrateConfig("hand", seed=3, file=str(file), views=10))
    found, ahead = read_calibration(file), np.array([0.0, 0.0, 0.1, 1.0])
    assert set(found.cameras) == {"head", "left_hand", "right_hand"} and found.joint_offset.any()
    for name in ("left_hand", "right_hand"):
        # The twin's cameras are where the model has them; what is wrong at first is what its stack believes.
        assert np.linalg.norm(found.cameras[name] @ ahead - ahead) < 0.0015
