"""Frontiers: where a map ends, and from where that can be looked at."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from tests.capabilities.navigation.rooms import room, wall_with_gap

from golem.capabilities.navigation.frontiers import frontiers
from golem.interfaces.nav_payloads import OccupancyGrid
from golem.types import PlanarPose

HERE = PlanarPose(0.0, 0.0, 0.0)


def seen_up_to(grid: OccupancyGrid, x: float) -> OccupancyGrid:
    """Return the map as it is while nobody has seen what is beyond `x` [m]."""
    cells = grid.cells.copy()
    cells[:, round((x - grid.origin.x) / grid.resolution) :] = -1
    return replace(grid, cells=cells)


def test_a_room_that_is_known_has_none() -> None:
    assert frontiers(room((3.0, 3.5, -1.0, 1.0)), 0.5, HERE) == []


def test_the_end_of_what_is_known_is_looked_at_from_a_metre_away() -> None:
    (frontier,) = frontiers(seen_up_to(room(), 4.0), 0.5, HERE)
    assert abs(frontier.pose.x - 3.0) < 0.15 and abs(frontier.pose.yaw) < 0.3
    assert frontier.length > 5.0


def test_what_is_behind_a_wall_is_none() -> None:
    grid = seen_up_to(room(*wall_with_gap((0.0, 0.0))), 6.0)
    assert frontiers(grid, 0.5, HERE) == []


def test_one_all_around_the_robot_is_looked_at_from_near_it() -> None:
    grid = room(size=(-8.0, 8.0, -8.0, 8.0))
    rows, columns = np.indices(grid.cells.shape)
    away = np.hypot(rows - 159.5, columns - 159.5) * grid.resolution
    (frontier,) = frontiers(replace(grid, cells=np.where(away < 5.0, grid.cells, np.int8(-1))), 0.5, HERE)
    assert math.hypot(frontier.pose.x, frontier.pose.y) > 3.5
    assert abs(frontier.pose.yaw - math.atan2(frontier.pose.y, frontier.pose.x)) < 0.3


def test_the_map_may_be_turned() -> None:
    turn = PlanarPose(1.0, -2.0, 0.8)
    grid = seen_up_to(room(), 4.0)
    (frontier,) = frontiers(replace(grid, origin=turn @ grid.origin), 0.5, turn @ HERE)
    (plain,) = frontiers(grid, 0.5, HERE)
    there = turn.to(frontier.pose)
    assert abs(there.x - plain.pose.x) < 0.3 and frontier.length == plain.length
