"""What `golem skill` makes of its words."""

from __future__ import annotations

import pytest

from golem.errors import ConfigError
from golem.middleware.dds.domain import DdsConfig
from golem.runtime.live.skill_client import PickErrand, StandErrand, WalkErrand, read_errand


@pytest.mark.parametrize("word", ["pick", "grasp"])
def test_a_pick(word: str) -> None:
    read = read_errand([word, "bolt", "--arm", "left", "--domain", "9"])
    assert read == ("/skill/pick", PickErrand("bolt", "left", dds=DdsConfig(domain=9)))
    goal = PickErrand("bolt", "left").goal
    assert (goal.label, goal.container, goal.side) == ("bolt", "tray", "left")


def test_a_walk_turns_into_a_pose() -> None:
    read = read_errand(["walk", "1.5", "-0.5", "1.5707963267948966", "--frame", "odom"])
    assert read is not None and isinstance(read[1], WalkErrand)
    pose = read[1].goal.pose
    assert (pose.header.frame_id, pose.pose.position.x, pose.pose.position.y) == ("odom", 1.5, -0.5)
    assert pose.pose.orientation.z == pytest.approx(0.5**0.5) == pose.pose.orientation.w
    with pytest.raises(ConfigError, match="finite"):
        _ = WalkErrand(float("nan")).goal


def test_standing_takes_a_time() -> None:
    goal = StandErrand(1.5).goal
    assert (goal.duration.sec, goal.duration.nanosec) == (1, 500000000)


def test_help_lists_the_skills_and_a_wrong_one_gets_the_near_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert read_errand(["--help"]) is None
    assert "/skill/walk" in capsys.readouterr().out
    with pytest.raises(ConfigError, match="Did you mean 'walk'"):
        read_errand(["wlak"])
