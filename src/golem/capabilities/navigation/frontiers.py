"""Where a map ends: places between what is known to be free and what nobody has seen (Yamauchi, 1997)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from golem.capabilities.navigation.costmap import INSCRIBED, Costmap
from golem.interfaces.nav_payloads import OccupancyGrid
from golem.types import PlanarPose

SMALLEST = 0.6
"""Length of a frontier from which on it is worth a way [m]."""
ASIDE = 0.1
"""Share of the way there that counts among places to look from: the straight look is the nearest [own]."""


@dataclass(frozen=True, slots=True)
class Frontier:
    """A border of free and unknown, `length` [m]; `pose` is a free place near it, heading to its middle."""

    pose: PlanarPose
    length: float


def frontiers(grid: OccupancyGrid, radius: float, base: PlanarPose, standoff: float = 1.0) -> list[Frontier]:
    """Return the frontiers of a map that can be looked at, the one that is worth most for its way first.

    Args:
        radius: distance that the robot keeps from obstacles [m].
        base: where the robot is, in the frame of the map's origin.
        standoff: distance from which a frontier is looked at [m].
    """
    free, unknown = (grid.cells >= 0) & (grid.cells <= 50), grid.cells < 0
    beside = cv2.dilate(unknown.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    border = (free & beside).astype(np.uint8)
    count, labels, stats, centroids = cv2.connectedComponentsWithStats(border, connectivity=8)
    costmap = Costmap(grid, np.zeros((0, 2)), radius)
    # Only what the robot can get to: the free room that it stands in, or is nearest to.
    _, rooms = cv2.connectedComponents(((costmap.cost < INSCRIBED) & free).astype(np.uint8))
    open_cells = np.argwhere(rooms > 0)
    if not len(open_cells):
        return []
    places = costmap.places(open_cells)
    nearest = open_cells[int(((places - (base.x, base.y)) ** 2).sum(axis=1).argmin())]
    mine = rooms[open_cells[:, 0], open_cells[:, 1]] == rooms[nearest[0], nearest[1]]
    places = places[mine]
    ways = np.hypot(*(places - (base.x, base.y)).T)
    found: list[tuple[float, Frontier]] = []
    for i in range(1, count):
        length = float(stats[i, cv2.CC_STAT_AREA]) * grid.resolution
        if length < SMALLEST:
            continue
        cells = np.argwhere(labels == i)
        # On the border itself: the middle of one around the robot is where the robot is.
        middle = costmap.places(cells[[((cells - centroids[i, ::-1]) ** 2).sum(axis=1).argmin()]])[0]
        off = np.abs(np.hypot(*(places - middle).T) - standoff)
        k = int((off + ASIDE * ways).argmin())
        if off[k] > 1.5:
            continue
        x, y = places[k].tolist()
        yaw = float(np.arctan2(middle[1] - y, middle[0] - x))
        found.append((length / (1.0 + float(ways[k])), Frontier(PlanarPose(x, y, yaw), length)))
    return [frontier for _, frontier in sorted(found, key=lambda row: -row[0])]
