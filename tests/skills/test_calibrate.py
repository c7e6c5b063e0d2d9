"""A robot with tags on its hands finds its own errors; one without says what it lacks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.sensors.calibration import read_calibration
from golem.runtime.lockstep import build
from golem.skills.calibrate import Calibrate, CalibrateGoal
from golem.stack import load_stack


@pytest.mark.parametrize("wrong", [{"views": 3}, {"views": 100}, {"settle": -1.0}])
def test_a_goal_without_sense_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        CalibrateGoal(**wrong)  # type: ignore[arg-type]


def test_more_views_get_more_time() -> None:
    assert Calibrate().timeout(CalibrateGoal(views=30)) > Calibrate().timeout(CalibrateGoal(views=8)) > 60.0


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_robot_finds_its_errors_and_uses_them(tmp_path: Path) -> None:
    file = tmp_path / "calibration.json"
    stack = load_stack("tether", profile="field").with_options("robot", tags=True, world="open")
    running, robot = build(stack.with_skill("calibrate", folder=str(tmp_path)), 1)
    result = running.execute("calibrate", {"file": file.name, "views": 12})
    assert result.success, result.reason
    found, ahead = read_calibration(file), np.array([0.0, 0.0, 1.0, 1.0])
    before, after = (np.linalg.norm(T @ ahead - ahead) for T in (robot.calibration["head"], found.cameras["head"]))
    assert before > 0.05 and after < 0.008
    zeros = robot.true_joint_offset[13:]
    assert np.sqrt(np.mean((found.joint_offset[13:] - zeros) ** 2)) < 0.2 * np.sqrt(np.mean(zeros**2))
    robot.close()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_robot_without_tags_says_so(tmp_path: Path) -> None:
    stack = load_stack("tether", profile="bench").with_options("robot", world="open")
    running, robot = build(stack.with_skill("calibrate", folder=str(tmp_path)), 0)
    result = running.execute("calibrate", {"file": "none.json", "views": 6})
    assert not result.success and "tags were seen in 0 postures" in result.reason
    assert not (tmp_path / "none.json").exists()
    robot.close()
