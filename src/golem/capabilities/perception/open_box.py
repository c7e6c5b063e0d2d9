"""An open box, such as a tray, from the cloud of one sighting: where its rim is, how full it is, where to let go."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.types import Array, LocalizedObject

WALL = 0.012
"""What stands higher than this above the middle of the box is wall [m]: several times the noise of the depth."""
TALLEST = 0.15
"""What stands higher than this is not the box [m]."""
CELL = 0.006
"""Side of the squares that walls are collected in [m]."""
EDGE = 0.01
"""Share of the walls' points that may lie beyond each side: they are off."""
SIDES_FROM, SIDES_TO = 0.06, 0.60
"""Range of the sides of a box [m]."""
GRID = 0.008
"""Side of the cells in which heights inside are told [m]: half of a screw."""
EDGE_ROOM = 0.02
"""What is this near to the rim may be wall [m]."""
LEAST = 4
"""Points that tell the height of a cell."""
LYING = 0.2
"""Share of the points inside that are lower than what is told of its contents: something may hang above it."""
FULL = 0.020
"""A box whose contents come this near to its rim is full [m]."""


@dataclass(frozen=True, slots=True)
class OpenBox:
    """An upright box that is open at the top, in odom.

    Attributes:
        center: (2,) middle of its rim [m].
        yaw: heading of its first side [rad].
        size: (2,) outer size along its first and its second side [m].
        rim: height of the rim [m].
        level: height of what the box shows inside: its floor, or what lies there [m].
    """

    center: Array
    yaw: float
    size: Array
    rim: float
    level: float

    @property
    def axes(self) -> Array:
        """(2, 2) its sides as columns."""
        return _axes(self.yaw)

    @property
    def full(self) -> bool:
        """Whether it takes nothing more."""
        return self.rim - self.level < FULL

    def contains(self, points: Array, margin: float = 0.0) -> NDArray[np.bool_]:
        """Return (n,) which of `points` (n, 2) or (n, 3) are, from above, inside the rim and `margin` [m] off it."""
        turned = np.abs((points[:, :2] - self.center) @ self.axes)
        return np.all(turned <= 0.5 * self.size - margin, axis=1)

    def heights(self, points: Array, beyond: int = 0) -> Array:
        """Return (nx, ny) mean heights of what lies inside, on a grid of `GRID`, `EDGE_ROOM` inside the rim [m].

        Args:
            points: (n, 3) of one or more views in odom [m]; cells with fewer than `LEAST` of them are NaN.
            beyond: cells by which the grid is larger, on each side.
        """
        halves, shape = self._grid(beyond)
        turned = (points[:, :2] - self.center) @ self.axes
        index = np.floor((turned + halves) / GRID).astype(int)
        inside = np.all((index >= 0) & (index < shape), axis=1)
        flat = np.ravel_multi_index(tuple(index[inside].T), tuple(shape))
        count = np.bincount(flat, minlength=int(shape.prod()))
        total = np.bincount(flat, weights=points[inside, 2], minlength=int(shape.prod()))
        return np.where(count >= LEAST, total / np.maximum(count, 1), np.nan).reshape(shape)

    def cells(self, beyond: int = 0) -> Array:
        """Return (nx, ny, 2) the middles of the cells of `heights`, in odom [m]."""
        halves, shape = self._grid(beyond)
        grid = np.stack(np.meshgrid(*(np.arange(n) + 0.5 for n in shape), indexing="ij"), axis=-1) * GRID - halves
        return self.center + grid @ self.axes.T

    def _grid(self, beyond: int) -> tuple[Array, NDArray[np.intp]]:
        """Return (2,) half of the sides of the grid of `heights` [m], and (2,) how many cells it has along each."""
        halves = np.maximum(0.5 * self.size - EDGE_ROOM, GRID) + beyond * GRID
        return halves, np.ceil(2.0 * halves / GRID).astype(int)

    def places(self, margin: float, spacing: float = 0.02) -> Array:
        """Return (n, 3) places at the height of `level`, `margin` [m] inside the rim and `spacing` [m] apart.

        The middle comes first. A box that is too narrow has its middle line, or its middle alone.
        """
        halves = np.maximum(0.5 * self.size - margin, 0.0)
        steps = [np.arange(-np.floor(h / spacing), np.floor(h / spacing) + 1) * spacing for h in halves]
        grid = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
        grid = grid[np.argsort(np.linalg.norm(grid, axis=1), kind="stable")]
        flat = self.center + grid @ self.axes.T
        return np.column_stack([flat, np.full(len(flat), self.level)])


def fit_open_box(sighting: LocalizedObject) -> OpenBox | None:
    """Return the box that a sighting shows; None where no walls stand around its middle.

    Walls are points that stand above the middle, and hang together on a grid over the ground. The box has the heading
    of the smallest rectangle around those that surround the middle (`cv2.minAreaRect`), and their extent along it.
    """
    middle = sighting.position
    above = sighting.points[:, 2] - middle[2]
    walls = sighting.points[(above > WALL) & (above < TALLEST)]
    if not len(walls):
        return None
    low = walls[:, :2].min(axis=0) - 2.0 * CELL
    index = ((walls[:, :2] - low) / CELL).astype(np.int32)
    cells = np.zeros(index.max(axis=0) + 3, np.uint8)
    cells[index[:, 0], index[:, 1]] = 1
    _, labels = cv2.connectedComponents(cv2.dilate(cells, np.ones((3, 3), np.uint8)), connectivity=8)
    here = labels[index[:, 0], index[:, 1]]
    candidates = [walls[here == label, :2] for label in range(1, int(labels.max()) + 1)]
    around = [p for p in candidates if (p.min(axis=0) < middle[:2]).all() and (p.max(axis=0) > middle[:2]).all()]
    if not around:
        return None
    own = max(around, key=lambda p: float(np.ptp(p, axis=0).prod()))
    yaw = float(np.deg2rad(cv2.minAreaRect(own.astype(np.float32))[2]))
    low, high = np.quantile(own @ _axes(yaw), (EDGE, 1.0 - EDGE), axis=0)
    size = high - low
    if size.min() < SIDES_FROM or size.max() > SIDES_TO:
        return None
    box = OpenBox(_axes(yaw) @ (0.5 * (low + high)), yaw, size, 0.0, 0.0)
    rim = float(np.quantile(walls[box.contains(walls), 2], 0.9))
    inside = sighting.points[box.contains(sighting.points, 0.1 * float(size.min()))]
    return replace(box, rim=rim, level=float(np.quantile(inside[:, 2], LYING)) if len(inside) else float(middle[2]))


def _axes(yaw: float) -> Array:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s], [s, c]])
