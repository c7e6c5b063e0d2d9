"""A file that a client names: a plain name in the folder of the skill, and nothing of another kind is replaced."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.skills.test_explore import Explorer
from tests.skills.test_walk import outcome

from golem.capabilities.mapping.map_file import StoredMap, save_map
from golem.errors import ConfigError
from golem.interfaces import topics
from golem.runtime.skill_table import SkillTable
from golem.skills.calibrate import CalibrateGoal
from golem.skills.explore import Explore, ExploreGoal
from golem.skills.kept_file import KeptFileConfig, check_file_name
from golem.stack import Stack
from golem.types import PlanarPose

WRONG = (
    *("../hall", "/etc/hall", "maps/hall", "..", ".", ".hidden", "~/hall", "a b", "hall\n", "h\0all", "C:\\hall"),
    *("h" * 10_000, "../" * 3000, "-rf", "hälle", " "),
)


@pytest.mark.parametrize("name", WRONG, ids=lambda name: repr(name[:12]))
def test_a_name_that_leads_anywhere_is_refused_in_one_sentence(name: str) -> None:
    for goal in (lambda: ExploreGoal(save=name), lambda: CalibrateGoal(file=f"{name}.json")):
        with pytest.raises(ConfigError, match="cannot be the name of a file") as refusal:
            goal()
        assert len(str(refusal.value)) < 300 and "folder" in str(refusal.value)
    with pytest.raises(ConfigError, match="cannot be the name of a file|characters; at most 1000"):
        SkillTable(Stack()).goal("explore", {"save": name})


def test_plain_names_pass_and_the_empty_one_keeps_nothing() -> None:
    for name in ("", "hall", "Hall-2_b", "h" * 64):
        check_file_name(name)
    check_file_name("calibration.json", ".json")
    for name in ("calibration.yaml", "calibration", ".json", "a.b.json"):
        with pytest.raises(ConfigError, match=r"'\.json' at the end"):
            CalibrateGoal(file=name)


def _explored(folder: Path, save: str) -> tuple[Explorer, str]:
    robot = Explorer()
    skill = Explore(KeptFileConfig(str(folder)))
    result = outcome(robot.run(skill.run(robot.context, ExploreGoal(most=0, save=save)), 30.0))
    return robot, f"{result.stage}: {result.reason}"


@pytest.mark.parametrize("ending", [".yaml", ".pgm", ".npz"])
def test_what_is_there_and_is_no_map_stays(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"stand{ending}").write_text("robot: {use: mujoco}\n")
    robot, said = _explored(tmp_path, "stand")
    assert said.startswith("refused") and "something else" in said
    assert robot.bus.latest(topics.TWIST) is None and robot.bus.latest(topics.MAP_SAVE) is None


def test_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "hall.pgm").symlink_to(tmp_path / "elsewhere")
    _, said = _explored(tmp_path, "hall")
    assert said.startswith("refused") and "is a link" in said


def _save_map(stem: Path) -> None:
    cells, nothing = np.zeros((3, 4), np.int8), np.zeros((0, 3))
    save_map(stem, StoredMap(PlanarPose(0.0, 0.0, 0.0), 0.1, cells, nothing, nothing[:, :2]))


def test_a_link_to_a_map_is_not_followed_either(tmp_path: Path) -> None:
    _save_map(tmp_path / "elsewhere")
    (tmp_path / "hall.pgm").symlink_to(tmp_path / "elsewhere.pgm")
    _, said = _explored(tmp_path, "hall")
    assert said.startswith("refused") and "is a link" in said


def test_a_map_replaces_a_map(tmp_path: Path) -> None:
    _save_map(tmp_path / "hall")
    _, said = _explored(tmp_path, "hall")
    assert said.startswith("done") and str(tmp_path / "hall.yaml") in said
