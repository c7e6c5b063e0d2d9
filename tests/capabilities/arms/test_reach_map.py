"""The map of reach: read back as it was written, mirrored for the left hand, and true where it is asked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.arms.goal_postures import GoalPostures
from golem.capabilities.arms.postures import downward, posture
from golem.capabilities.arms.reach_map import ReachMap, load_map, save_map
from golem.capabilities.planning.joint_space import JointSpace, PlanningRobot
from golem.errors import ConfigError

GRID = ReachMap(
    np.array([0.3, -0.2, 0.0]), 0.1, -1.57,
    np.array([[[0.1, -1.0], [0.05, 0.0]]]), np.array([[[0.01, 0.0], [0.02, 0.03]]]),
)  # fmt: skip


def test_a_map_is_read_back_as_it_was_written(tmp_path: Path) -> None:
    save_map(GRID, tmp_path / "reach.json")
    back = load_map(tmp_path / "reach.json")
    np.testing.assert_allclose(back.margin, GRID.margin)
    np.testing.assert_allclose(back.com_shift, GRID.com_shift)
    np.testing.assert_allclose(back.points(), GRID.points())


def test_the_nearest_point_answers() -> None:
    assert GRID.serves("right", np.array([0.34, -0.16, 0.04]))
    assert not GRID.serves("right", np.array([0.3, -0.2, 0.06]))
    assert GRID.serves("left", np.array([0.3, 0.2, 0.0]))
    assert GRID.comfort("left", np.array([0.3, 0.1, 0.0])) == pytest.approx(0.05)
    for far in ([0.5, -0.2, 0.0], [0.3, -0.2, -0.06], [np.nan, 0.0, 0.0]):
        assert not GRID.serves("right", np.array(far))


@pytest.mark.parametrize("text", ["", "[]", '{"format": "golem-reach-0"}', '{"format": "golem-reach-1"}'])
def test_what_is_no_map_is_refused(text: str, tmp_path: Path) -> None:
    file = tmp_path / "reach.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match="golem reach --out FILE"):
        load_map(file)


def test_the_shipped_map_is_of_this_robot() -> None:
    reach, finder, robot = load_map(), GoalPostures(), PlanningRobot()
    space = JointSpace(robot, posture("home"))
    points, rng = reach.points(), np.random.default_rng(0)
    served = [tuple(i) for i in np.argwhere(reach.margin > 0.02)]
    for k in rng.choice(len(served), 4, replace=False):
        x, y, z = points[served[k]]
        for sign, side in ((1.0, "right"), (-1.0, "left")):
            T = downward(x, sign * y, z, sign * reach.yaw)
            targets = (T, None) if side == "left" else (None, T)
            start = posture(f"ready_{side}")
            assert len(finder.find(*targets, start, lambda q: space.verdict(q) == 0)), (side, x, y, z)
