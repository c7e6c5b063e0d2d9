"""The node of the mapper: what it publishes, how it keeps a map, and whom it names when something is wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from golem.capabilities.mapping.map_file import load_map
from golem.capabilities.mapping.voxel_grid import VoxelGridMapper
from golem.errors import ModuleFault
from golem.evaluation.conformance.mapper_suite import MapperSuite
from golem.interfaces import topics
from golem.interfaces.nav_payloads import MapFile, OccupancyGrid
from golem.interfaces.payloads import Odometry
from golem.interfaces.ros_convert import occupancy_grid
from golem.middleware.bus import Bus
from golem.robots.model.spatial import transform
from golem.runtime.contract_check import ContractCheck
from golem.runtime.odometry_node import MapperNode
from golem.types import BaseEstimate, PlanarPose


def run(mapper: Any, count: int = 6) -> Bus:
    bus = Bus()
    node = MapperNode(bus, mapper, ContractCheck("mapper", "mine"))
    for scan in list(MapperSuite().inputs())[:count]:
        bus.publish(topics.ODOMETRY, Odometry(scan.t, transform((1.0, 0.0, 0.0))), scan.t)
        bus.publish(topics.BASE, BaseEstimate(scan.t, transform((1.2, 0.1, 0.0))), scan.t)
        bus.publish(topics.SCAN, scan, scan.t)
        node.step(scan.t)
    bus.publish(topics.MAP_SAVE, MapFile(str(run.path)), 9.0)
    node.step(9.0)
    return bus


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path) -> None:
    run.path = tmp_path / "kept" / "hall"


def test_map_and_place_are_published_and_the_map_is_kept() -> None:
    bus = run(VoxelGridMapper())
    grid, place = bus.latest(topics.MAP), bus.latest(topics.MAP_POSE)
    assert grid is not None and place is not None
    # The base estimate is 0.2 m ahead of the odometry and 0.1 m to its left: its odom is that much behind on the map.
    assert (place.T_map_estimate.x, place.T_map_estimate.y) == pytest.approx((-0.2, -0.1))
    message = occupancy_grid(grid)
    assert message.header.frame_id == "map" and message.info.width * message.info.height == len(message.data)
    saved = bus.latest(topics.MAP_SAVED)
    assert saved is not None and not saved.problem
    assert load_map(run.path).cells.shape[1] >= message.info.width


def test_a_map_that_is_not_there_yet_or_cannot_be_written_is_said() -> None:
    saved = run(VoxelGridMapper(), 0).latest(topics.MAP_SAVED)
    assert saved is not None and "no map yet" in saved.problem
    run.path.parent.parent.joinpath("kept").write_text("a file")
    saved = run(VoxelGridMapper()).latest(topics.MAP_SAVED)
    assert saved is not None and "cannot be written" in saved.problem


def test_a_mapper_that_breaks_its_contract_is_named() -> None:
    class Wrong(VoxelGridMapper):
        def grid(self) -> OccupancyGrid | None:
            grid = super().grid()
            return grid and OccupancyGrid(0.0, PlanarPose(0.0, 0.0, 0.0), 0.05, np.zeros((2, 2)))  # pyright: ignore

    with pytest.raises(ModuleFault, match="int8"):
        run(Wrong())
