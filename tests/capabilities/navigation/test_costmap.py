"""The costmap: Nav2's inflation, what the scan adds, and frames."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from tests.capabilities.navigation.rooms import room

from golem.capabilities.navigation.costmap import INSCRIBED, LETHAL, STEEPEST, Costmap, CostmapConfig
from golem.errors import ConfigError
from golem.types import PlanarPose

NOTHING = np.zeros((0, 2))


def test_costs_fall_exponentially_from_the_inscribed_radius_on() -> None:
    costmap = Costmap(room((3.0, 3.5, -1.0, 1.0)), NOTHING, 0.4, CostmapConfig(decay=4.0, inflation=1.0))
    # The obstacle's first cell is at x = 3.025; a place is taken for the middle of its cell.
    at = costmap.at(np.array([[3.2, 0.0], [2.7, 0.0], [2.325, 0.0], [1.0, 0.0]]))
    assert at[0] == LETHAL and at[1] == INSCRIBED and at[3] == 0.0
    assert at[2] == pytest.approx(STEEPEST * math.exp(-4.0 * (0.7 - 0.4)), rel=0.05)


def test_what_a_scan_hits_is_an_obstacle_too() -> None:
    costmap = Costmap(room(), np.array([[2.0, 0.5], [1e9, 0.0], [np.nan, 0.0]]), 0.3)
    assert costmap.at(np.array([[2.0, 0.5]]))[0] == LETHAL
    assert costmap.free_at(np.array([[2.0, 0.0]]))[0] == pytest.approx(0.5, abs=0.06)


def test_unknown_cells_cost_something_and_may_be_closed() -> None:
    grid = room()
    cells = grid.cells.copy()
    cells[60, 100] = -1
    place = np.array([[3.02, 0.02]])
    assert Costmap(replace(grid, cells=cells), NOTHING, 0.3).at(place)[0] == CostmapConfig().unknown
    closed = CostmapConfig(unknown=253.0)
    assert Costmap(replace(grid, cells=cells), NOTHING, 0.3, closed).at(place)[0] == INSCRIBED


def test_a_map_that_is_turned_has_its_obstacles_where_they_are() -> None:
    grid = room((3.0, 3.5, -0.2, 0.2))
    turn = PlanarPose(1.0, 2.0, 0.7)
    turned = Costmap(replace(grid, origin=turn @ grid.origin), NOTHING, 0.3)
    at = turn @ PlanarPose(3.2, 0.0, 0.0)
    assert turned.at(np.array([[at.x, at.y]]))[0] == LETHAL
    row, column, _ = turned.cells(np.array([[at.x, at.y]]))
    places = turned.places(np.column_stack([row, column]))
    assert np.abs(places - (at.x, at.y)).max() < 0.05


def test_wrong_options_are_refused() -> None:
    with pytest.raises(ConfigError, match="decay"):
        CostmapConfig(decay=0.0)
