from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from golem.evaluation.base import TrialSpec
from golem.evaluation.episodes.episode import episode_seed
from golem.evaluation.rungs import calibrated_robot as rung
from golem.evaluation.rungs.errands import ErrandsOptions, ErrandsRung
from golem.robots.sensors.calibration import point_moved, read_calibration
from golem.runtime.lockstep import build_robot
from golem.skills.base import SkillResult, StageFailed
from golem.stack import load_stack


@pytest.mark.slow
def test_a_robot_that_was_calibrated_first_is_calibrated_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stack, seed = load_stack("counter-tether", profile="field"), episode_seed(9, 0)
    file = Path(rung.calibrated(stack, seed, str(tmp_path / "kept")).parts["calibration"]["file"])
    robot = build_robot(stack, seed)
    try:
        assert point_moved(robot.calibration["head"], 1.0) > 0.04
    finally:
        robot.close()
    assert read_calibration(file).moved("head", 1.0) < 0.01

    def never(*_: Any) -> Any:
        raise AssertionError("it was calibrated again")

    monkeypatch.setattr(rung, "calibrate", never)
    rung_of_errands = ErrandsRung(ErrandsOptions(calibrated=str(tmp_path / "kept")))
    for errand in ("k01", "p25"):
        spec = TrialSpec("errands", "object_map", "field", 9, 0, case={"errand": errand})
        assert Path(rung_of_errands.stack_of(spec).parts["calibration"]["file"]) == file


def test_a_calibration_that_fails_is_a_failed_stage_and_leaves_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lost = SkillResult(False, "views", "skill", "No tag was seen.", {})
    monkeypatch.setattr(rung, "calibrate", lambda *_: lost)
    with pytest.raises(StageFailed, match="No tag was seen"):
        rung.calibrated(load_stack("stand", profile="field"), 0, str(tmp_path))
    assert not list(tmp_path.iterdir())
