"""Figures of mapping and navigation: a scan into the map, the costmap, a way over it, a twist along it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from golem.capabilities.mapping.voxel_grid import VoxelGridMapper
from golem.capabilities.navigation.astar import Way, astar
from golem.capabilities.navigation.costmap import INSCRIBED, Costmap
from golem.capabilities.navigation.footprint import HOME
from golem.capabilities.navigation.local_controller import Around, LocalController, LocalControllerConfig
from golem.evaluation.conformance.room import ROOM, MadeWalk
from golem.interfaces.nav_payloads import OccupancyGrid
from golem.types import Array, PlanarPose

SIDE, BOXES = 400, 60
"""Cells along each side of the map, and boxes of 1 m on it."""
Timed = Callable[[Callable[[int], object], int], Array]


def navigation_times(timed: Timed, n: int) -> list[tuple[str, Array, str]]:
    """Return names, CPU times of `n` repetitions by `timed` [s], and what they are compared with."""
    rng = np.random.default_rng(0)
    cells = np.zeros((SIDE, SIDE), np.int8)
    for r, c in rng.integers(20, SIDE - 40, (BOXES, 2)):
        cells[r : r + 20, c : c + 20] = 100
    grid = OccupancyGrid(0.0, PlanarPose(0.0, 0.0, 0.0), 0.05, cells)
    costmap = Costmap(grid, np.zeros((0, 2)), 0.3)
    walk, mapper = MadeWalk(ROOM, still=1e3, every=1), VoxelGridMapper()
    scans = walk.base_scans(n + 3, np.random.default_rng(1))
    for scan in scans[:3]:
        mapper.add_scan(scan)
    mapper.grid()

    def search(i: int) -> object:
        return astar(costmap.cost, (2, 2), (SIDE - 3, SIDE - 3), 0.02, INSCRIBED)

    local, pose, goal = (LocalController(LocalControllerConfig()), PlanarPose(1.0, 1.0, 0.8), PlanarPose(4.0, 4.0, 0.0))
    way, frame = Way(np.linspace((1.0, 1.0), (4.0, 4.0), 80)), np.array([0.0, 0.0, 1.0, 0.0, 0.05])

    def follow(i: int) -> object:
        return local.follow(pose, way, goal, HOME, Around(costmap.clearance, frame))

    search(0)
    follow(0)
    return [
        ("map: one scan of 20,000 points", timed(lambda i: mapper.add_scan(scans[i + 3]), n), "100 ms: 10 Hz"),
        ("costmap of 400 x 400", timed(lambda i: Costmap(grid, np.zeros((0, 2)), 0.3), n), "100 ms: 10 Hz"),
        ("A* over 400 x 400, corner to corner", timed(search, n), "20 ms (issue 28)"),
        ("local controller: one twist", timed(follow, n), "50 ms: 20 Hz"),
    ]
