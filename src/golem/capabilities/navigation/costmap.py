"""What it costs to be in a cell of the floor: Nav2's inflation of the map, and of what the newest scan hit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.interfaces.nav_payloads import OccupancyGrid
from golem.options import require
from golem.types import Array

LETHAL, INSCRIBED, STEEPEST = 254.0, 253.0, 252.0
"""Costs of a cell with an obstacle, of one nearer to an obstacle than the robot's inscribed radius, and the highest of
one further off; Nav2's."""


@dataclass(frozen=True, slots=True)
class CostmapConfig:
    """Options of the costmap.

    Attributes:
        decay: how fast the cost falls with the distance from an obstacle [1/m].
        inflation: distance from an obstacle at which it is zero [m].
        unknown: cost of a cell that nobody has seen; 253 and more closes it.
        occupied: value of a cell of the map from which on it holds an obstacle, 1 to 100.
    """

    decay: float = 4.0
    inflation: float = 1.2
    unknown: float = 20.0
    occupied: int = 65

    def __post_init__(self) -> None:
        require(
            "costmap option ",
            ("decay", self.decay, 0.0 < self.decay < math.inf, "a positive number per metre"),
            ("inflation", self.inflation, 0.0 <= self.inflation <= 10.0, "a distance of at most 10 m"),
            ("unknown", self.unknown, 0.0 <= self.unknown <= LETHAL, "a cost from 0 to 254"),
            ("occupied", self.occupied, 1 <= self.occupied <= 100, "from 1 to 100"),
        )


class Costmap:
    """Costs on the cells of a map.

    Attributes:
        origin: pose of the corner of cell [0, 0] in the frame of the map.
        resolution: side of a cell [m].
        shape: rows and columns.
        cost: (rows, columns) 0 to 254, by the distance d [m] of a cell's middle from the nearest obstacle's: `LETHAL`
            at 0, `INSCRIBED` up to the inscribed radius r, then 252 exp(-decay (d - r)), and at least `unknown` where
            nobody has looked.
        clearance: (rows, columns) d, at most 10 m.
    """

    def __init__(self, grid: OccupancyGrid, points: Array, radius: float, config: CostmapConfig | None = None) -> None:
        """Inflate obstacles of a map, and `points` (n, 2) in its frame [m], by the robot's inscribed `radius` [m]."""
        config = config or CostmapConfig()
        self.origin, self.resolution, self.shape = grid.origin, grid.resolution, grid.cells.shape
        full = grid.cells >= config.occupied
        if len(points):
            row, column, inside = self.cells(points)
            full = full.copy()
            full[row[inside], column[inside]] = True
        self.clearance: Array = distance_to(full, grid.resolution)
        outside = np.maximum(self.clearance - radius, 0.0)
        cost = STEEPEST * np.exp(-config.decay * outside)
        cost[outside > config.inflation] = 0.0
        cost = np.where(grid.cells < 0, np.maximum(cost, config.unknown), cost)
        cost[self.clearance <= radius] = INSCRIBED
        cost[full] = LETHAL
        self.cost: Array = cost

    def cells(self, points: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Return (n,) rows, columns, and whether they are inside, of points (n, 2) in the frame of the map [m]."""
        c, s = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        local = (points - (self.origin.x, self.origin.y)) @ np.array([[c, -s], [s, c]])
        index = np.floor(local / self.resolution)
        index = np.where(np.isfinite(index), np.clip(index, -1e9, 1e9), -1.0).astype(np.int64)
        rows, columns = self.shape
        column, row = index.T
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return row, column, inside

    def places(self, cells: NDArray[np.int64]) -> Array:
        """Return the (n, 2) middles of cells (n, 2), row and column each, in the frame of the map [m]."""
        local = (cells[:, ::-1] + 0.5) * self.resolution
        c, s = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        return np.asarray(local @ np.array([[c, s], [-s, c]]) + (self.origin.x, self.origin.y), np.float64)

    def corner(self, row: int, column: int) -> tuple[float, float]:
        """Return where the corner of a cell is in the frame of the map [m]."""
        c, s = math.cos(self.origin.yaw), math.sin(self.origin.yaw)
        x, y = column * self.resolution, row * self.resolution
        return self.origin.x + c * x - s * y, self.origin.y + s * x + c * y

    def at(self, points: Array, outside: float = LETHAL) -> Array:
        """Return the (n,) cost at points (n, 2); beside the map it is `outside`."""
        row, column, inside = self.cells(points)
        found = np.full(len(points), outside)
        found[inside] = self.cost[row[inside], column[inside]]
        return found

    def free_at(self, points: Array, outside: float = 10.0) -> Array:
        """Return the (n,) distance from the nearest obstacle at points (n, 2) [m]; beside the map it is `outside`."""
        row, column, inside = self.cells(points)
        found = np.full(len(points), outside)
        found[inside] = self.clearance[row[inside], column[inside]]
        return found


def distance_to(full: NDArray[np.bool_], resolution: float) -> Array:
    """Return the distance of each cell from the nearest full one [m], at most 10 m."""
    if not full.any():
        return np.full(full.shape, 10.0)
    distance = cv2.distanceTransform(np.where(full, 0, 255).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    return np.minimum(distance.astype(np.float64) * resolution, 10.0)
