"""The gantry beside the robot: where its tool is, and what it says."""

from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.evaluation.episodes.gantry_cell import REMOVAL, GantryCell
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.mujoco.config import MujocoConfig
from golem.robots.mujoco.engine import MujocoRobot
from golem.robots.worlds.layout import GANTRY
from golem.runtime.lockstep import start_posture
from golem.skills.gantry import SENTENCE
from golem.types import Array


def test_it_says_where_it_goes_lifts_its_tool_on_the_way_and_parks_in_the_end() -> None:
    bus, robot = Bus(), MujocoRobot("ideal", 0, start_posture(), MujocoConfig(gantry=True))
    number = int(robot.scene.model.body(GANTRY).mocapid[0])

    def tool() -> Array:
        return robot.data.mocap_pos[number].copy()

    home, first, second = tool(), np.array([0.43, 0.0, 1.08]), np.array([0.43, 0.5, 1.08])
    cell = GantryCell(robot, bus, [("Screw_1", first), ("Nut_2", second)], 5.0)
    assert cell.due == 5.0
    heard, tips = list[str](), list[Array]()
    for k in range(4 * round(REMOVAL)):
        cell(5.0 + k)
        said = SENTENCE.fullmatch(bus.latest(topics.REMOVALS) or "")
        assert said is not None
        heard.append(said[1])
        tips.append(tool())
    assert [heard.index("Screw_1"), heard.index("Nut_2"), heard[-1]] == [0, round(REMOVAL), "Nut_2"]
    assert tips[0] == pytest.approx(home) and tips[-1] == pytest.approx(home)
    assert tips[round(REMOVAL) - 1] == pytest.approx(first) and tips[2 * round(REMOVAL) - 1] == pytest.approx(second)
    away = [tip for tip in tips if min(np.hypot(*(tip - place)[:2]) for place in (first, second)) > 0.05]
    assert len(away) > 4 and all(tip[2] > 1.3 for tip in away)


def test_only_a_world_with_a_pack_has_one() -> None:
    with pytest.raises(ConfigError, match="no pack"):
        MujocoConfig(world="open", gantry=True)
