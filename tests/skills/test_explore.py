"""Exploring: a robot that follows every twist exactly, in a room that it sees 2.5 m far."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from tests.capabilities.navigation.rooms import room
from tests.skills.test_walk import Ground, outcome

from golem.interfaces import topics
from golem.interfaces.nav_payloads import MapFile, MapPlace, OccupancyGrid
from golem.middleware.bus import News
from golem.skills.explore import LEG, LOOK, SAVING, Explore, ExploreGoal
from golem.skills.kept_file import KeptFileConfig
from golem.types import PlanarPose, Twist

ORIGIN = PlanarPose(0.0, 0.0, 0.0)


@dataclass
class Explorer(Ground):
    """Maps what is within 2.5 m of it."""

    problem: str = ""
    grid: OccupancyGrid = field(default_factory=lambda: room(size=(-2.0, 6.0, -2.0, 2.0)))

    def __post_init__(self) -> None:
        self.seen = np.full(self.grid.cells.shape, -1, np.int8)
        rows, columns = np.indices(self.seen.shape)
        o, h = self.grid.origin, self.grid.resolution
        self.places = np.stack([o.x + (columns + 0.5) * h, o.y + (rows + 0.5) * h])
        super().__post_init__()
        self.saves = News(self.bus, topics.MAP_SAVE)

    def _advance(self) -> None:
        super()._advance()
        t = self.context.t
        asked = self.saves.read() if hasattr(self, "saves") else None
        if asked is not None:
            self.bus.publish(topics.MAP_SAVED, MapFile(asked.path, self.problem), t)
        if round(t * 100) % 20 == 0 or self.bus.latest(topics.MAP) is None:
            near = np.hypot(self.places[0] - self.pose.x, self.places[1] - self.pose.y) < 2.5
            self.seen[near] = self.grid.cells[near]
            self.bus.publish(topics.MAP, replace(self.grid, t=t, cells=self.seen.copy()), t)
            self.bus.publish(topics.MAP_POSE, MapPlace(t, ORIGIN, ORIGIN), t)


def test_it_sees_the_whole_room_and_comes_home(tmp_path: Path) -> None:
    robot = Explorer()
    skill = Explore(KeptFileConfig(str(tmp_path)))
    result = outcome(robot.run(skill.run(robot.context, ExploreGoal(save="hall")), 120.0))
    assert result.success and str(tmp_path / "hall.yaml") in result.reason
    inside = robot.seen[1:-1, 1:-1]
    assert (inside >= 0).mean() > 0.95
    assert abs(robot.pose.x) < 0.05 and abs(robot.pose.y) < 0.05
    assert robot.stages[0] == "explore" and robot.stages[-1] == "done" and "home" in robot.stages


def test_the_last_frontier_the_way_home_and_the_map_get_their_time() -> None:
    last, home = LEG + LOOK, 2.0 * LEG
    assert Explore().timeout(ExploreGoal(timeout=100.0)) > 100.0 + last + home + SAVING


def test_a_map_that_cannot_be_kept_is_said() -> None:
    robot = Explorer(problem="The map 'x' cannot be written: no room.")
    result = outcome(robot.run(Explore().run(robot.context, ExploreGoal(most=0, save="x")), 60.0))
    assert (result.success, result.stage, result.slot) == (False, "save", "mapper")
    assert "cannot be written" in result.reason


@pytest.mark.parametrize("most", [0, 3], ids=["on the way home", "on the way out"])
def test_the_map_is_kept_where_the_trip_fails(tmp_path: Path, most: int) -> None:
    robot = Explorer(offset=0.0, silent=1.0)
    skill = Explore(KeptFileConfig(str(tmp_path)))
    result = outcome(robot.run(skill.run(robot.context, ExploreGoal(most=most, save="hall")), 60.0))
    assert (result.success, result.slot) == (False, "odometry") and "silent" in result.reason
    assert result.reason.endswith(f"The map is in {tmp_path / 'hall'}.yaml.") and robot.twist == Twist()


@pytest.mark.parametrize("at", [0.05, 4.0, 12.0])
def test_cancelled_at_any_stage_it_stands_and_stays(at: float) -> None:
    robot = Explorer()
    run = robot.run(Explore().run(robot.context, ExploreGoal()), at)
    assert run.result is None
    run.cancel()
    for _ in range(20):
        robot._advance()
        run.step()
        robot.node.step(robot.context.t)
    place = robot.pose
    assert run.result is not None and run.result.stage == "cancelled"
    for _ in range(50):
        robot._advance()
        robot.node.step(robot.context.t)
    assert robot.twist == Twist() and robot.pose == place


def test_without_a_map_it_does_not_begin() -> None:
    ground = Ground(offset=0.0)
    result = outcome(ground.run(Explore().run(ground.context, ExploreGoal()), 30.0))
    assert (result.success, result.stage) == (False, "locate") and ground.pose == ORIGIN
