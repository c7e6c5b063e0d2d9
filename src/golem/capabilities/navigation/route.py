"""From a costmap and two poses to a way, or to the reason why there is none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.navigation.astar import Cell, astar
from golem.capabilities.navigation.costmap import INSCRIBED, LETHAL, STEEPEST, Costmap
from golem.capabilities.navigation.footprint import Footprint
from golem.capabilities.navigation.way import Way
from golem.types import Array, PlanarPose


@dataclass(frozen=True, slots=True)
class NoWay:
    """That there is no way.

    Attributes:
        why: one sentence.
        final: whether it is so however long the robot waits and wherever it backs up to.
    """

    why: str
    final: bool = False


def find_way(costmap: Costmap, start: PlanarPose, goal: PlanarPose, footprint: Footprint, beta: float) -> Way | NoWay:
    """Return the cheapest way, or why there is none.

    Near the start and the goal the footprint decides, not the distance at which ways keep from obstacles: the robot
    stands there as it does, and may stand close to something beside or behind it.
    """
    places = np.array([[start.x, start.y], [goal.x, goal.y]])
    row, column, inside = costmap.cells(places)
    if not inside[1]:
        return NoWay(f"The goal ({goal.x:.2f}, {goal.y:.2f}) is outside the map.", final=True)
    if not inside[0]:
        return NoWay(f"The robot, at ({start.x:.2f}, {start.y:.2f}), is outside the map.", final=True)
    hit = costmap.free_at(footprint.at(goal)) <= 0.5 * costmap.resolution
    if hit.any():
        at = footprint.at(goal)[int(hit.argmax())]
        return NoWay(
            f"The goal ({goal.x:.2f}, {goal.y:.2f}) is inside an obstacle: there the robot would touch something at "
            f"({at[0]:.2f}, {at[1]:.2f})."
        )
    cost = costmap.cost.copy()
    cells: list[Cell] = [(int(row[i]), int(column[i])) for i in range(2)]
    for cell in cells:
        _open(cost, cell, footprint.reach / costmap.resolution)
    found = astar(cost, cells[0], cells[1], beta, INSCRIBED)
    if found is None:
        return NoWay(
            f"There is no way to ({goal.x:.2f}, {goal.y:.2f}) on the map: it is walled in, or the gaps are narrow."
        )
    points = costmap.places(found[0])
    points[0], points[-1] = places
    return Way(points)


def way_cost(costmap: Costmap, points: Array, beta: float) -> float:
    """Return what places (n, 2) in their order cost by the paper's equation, in cells; infinite where one is closed."""
    cost = costmap.at(points[1:])
    if len(points) < 2 or (cost >= LETHAL).any():
        return float("inf")
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1) / costmap.resolution
    return float((steps * (1.0 + beta * cost)).sum())


def _open(cost: Array, cell: Cell, radius: float) -> None:
    """Let ways lead through what is no obstacle itself within `radius` [cells] of a cell, at the highest cost."""
    n = int(radius) + 1
    r0, r1 = max(0, cell[0] - n), min(cost.shape[0], cell[0] + n + 1)
    c0, c1 = max(0, cell[1] - n), min(cost.shape[1], cell[1] + n + 1)
    part = cost[r0:r1, c0:c1]
    rows: NDArray[np.int64]
    rows, columns = np.ogrid[r0:r1, c0:c1]
    near = (rows - cell[0]) ** 2 + (columns - cell[1]) ** 2 <= radius**2
    part[near & (part >= INSCRIBED) & (part < LETHAL)] = STEEPEST
