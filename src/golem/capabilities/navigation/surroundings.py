"""What is around a robot on its way: the map, and what the newest scan hit that is not in the map."""

from __future__ import annotations

import math

import numpy as np

from golem.capabilities.navigation.costmap import Costmap, CostmapConfig, distance_to
from golem.capabilities.navigation.movers import Movers
from golem.interfaces.nav_payloads import OccupancyGrid, Scan
from golem.types import Array, PlanarPose

HALF = 4.0
"""Half side of the window around the robot in which twists are tried [m]."""
BAND = (0.12, 1.9)
"""Heights above the floor at which a point of a scan is in the way [m]."""
KNOWN = 0.15
"""Distance from an obstacle of the map within which a point belongs to it [m]."""
REACH = 6.0
"""Distance up to which the points of a scan are new obstacles [m]."""


class Surroundings:
    """Keeps the costmap of the newest map, and the clearance around the robot by the newest scan.

    Attributes:
        costmap: by the map alone; None before there is one.
        clearance: (rows, columns) of the window, the distance from the nearest obstacle [m]; what is not in the map
            counts as nearer than it is by `shy`.
        frame: (5,) x, y, cosine and sine of the corner of the window in the frame of the map, and its resolution.
        new: (n, 2) points of the newest scan that are in no obstacle of the map [m].
    """

    def __init__(self, config: CostmapConfig, shy: float, ahead: float) -> None:
        """Wait for a map; for `shy` [m] see `clearance`, and the way of those who walk is kept free for `ahead` [s]."""
        self._config, self._shy, self._ahead = config, shy, ahead
        self._movers = Movers()
        self.forget()

    def forget(self) -> None:
        """Wait for a map again."""
        self.costmap: Costmap | None = None
        self._grid: OccupancyGrid | None = None
        self._movers.forget()
        self.clearance: Array = np.full((1, 1), 10.0)
        self.frame: Array = np.array([0.0, 0.0, 1.0, 0.0, 1.0])
        self.new: Array = np.zeros((0, 2))
        self._seen = 0.0

    def drop_new(self) -> None:
        """Leave out, until the next scan, what is not in the map."""
        self.new = np.zeros((0, 2))

    def update(self, grid: OccupancyGrid, scan: Scan | None, pose: PlanarPose, radius: float) -> None:
        """Take the newest scan, None for none that counts; no way leads within `radius` [m] of an obstacle."""
        if self._grid is not grid:
            self._grid = grid
            self.costmap = Costmap(grid, np.zeros((0, 2)), radius, self._config)
        costmap = self.costmap
        assert costmap is not None
        if scan is not None:
            points = scan.points[:, :2]
            height = scan.heights
            square = ((points - (pose.x, pose.y)) ** 2).sum(axis=1)
            points = points[(height > BAND[0]) & (height < BAND[1]) & (square < REACH**2)]
            self.new = points[costmap.free_at(points) > KNOWN]
            if self._ahead > 0.0:
                self._movers.update(scan.t, points, (pose.x, pose.y))
                self._seen = scan.t
        self._window(costmap, pose)

    def people(self, age: float) -> Array:
        """Return those who walk, `age` [s] after the newest scan; see `local_controller.Around`."""
        people = self._movers.people(self._seen + age)
        people[:, 4] += self._shy
        return people

    def with_new(self, radius: float) -> Costmap | None:
        """Return the costmap with the newest scan in it, and where people will be; None before there is a map."""
        if self._grid is None:
            return None
        there = np.concatenate([self.new, self._movers.ahead(self._ahead)])
        return Costmap(self._grid, there, radius, self._config)

    def _window(self, costmap: Costmap, pose: PlanarPose) -> None:
        """Draw the window around the robot, aligned with the map."""
        h, (rows, columns) = costmap.resolution, costmap.shape
        row, column, _ = (a[0] for a in costmap.cells(np.array([[pose.x, pose.y]])))
        half = math.ceil(HALF / h)
        r0, r1 = max(0, row - half), min(rows, row + half)
        c0, c1 = max(0, column - half), min(columns, column + half)
        if r0 >= r1 or c0 >= c1:
            self.clearance = np.full((1, 1), 10.0)
            return
        clearance = costmap.clearance[r0:r1, c0:c1]
        if len(self.new):
            row, column, inside = costmap.cells(self.new)
            inside &= (row >= r0) & (row < r1) & (column >= c0) & (column < c1)
            full = np.zeros(clearance.shape, np.bool_)
            full[row[inside] - r0, column[inside] - c0] = True
            clearance = np.minimum(clearance, distance_to(full, h) - self._shy)
        x, y = costmap.corner(int(r0), int(c0))
        yaw = costmap.origin.yaw
        self.clearance = np.ascontiguousarray(clearance)
        self.frame = np.array([x, y, math.cos(yaw), math.sin(yaw), h])
