"""The cheapest way over a costmap by A*: equation (1) of the paper.

Of all ways g_0 ... g_N over the 8 neighbours of each cell the one with the least sum of |g_k+1 - g_k| + beta C(g_k+1),
lengths in cells, by A* with the Euclidean distance to the goal as heuristic. That never exceeds what is left, and never
falls by more than a step costs, so that a cell is final the first time it is taken.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from golem.kernels import njit
from golem.types import Array, PlanarPose


class Way:
    """Places in their order: `points` (n, 2) at most a cell apart, n at least 1 [m]."""

    def __init__(self, points: Array) -> None:
        """Follow `points`, with the corners of the grid taken off."""
        self.points = _smooth(points)
        self._along: Array = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.points, axis=0), axis=1))])

    def nearest(self, pose: PlanarPose) -> tuple[int, float]:
        """Return the place nearest to a pose, and its distance [m]."""
        off = np.hypot(self.points[:, 0] - pose.x, self.points[:, 1] - pose.y)
        i = int(off.argmin())
        return i, float(off[i])

    def left(self, i: int) -> float:
        """Return the length of the way from place `i` to its end [m]."""
        return float(self._along[-1] - self._along[i])

    def ahead(self, i: int, distance: float) -> PlanarPose:
        """Return the place `distance` [m] ahead of place `i`, or the end, and the heading of the way there."""
        j = min(int(np.searchsorted(self._along, self._along[i] + distance)), len(self.points) - 1)
        a, b = self.points[max(0, j - 4)], self.points[j]
        return PlanarPose(float(b[0]), float(b[1]), math.atan2(b[1] - a[1], b[0] - a[0]) if j > 0 else 0.0)


def _smooth(points: Array, width: int = 5) -> Array:
    """Return the mean of `width` neighbours at each place, fewer towards the ends, which stay."""
    n = len(points)
    if n < 3:
        return points
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(points, axis=0)])
    i = np.arange(n)
    half = np.minimum(np.minimum(i, n - 1 - i), width)
    return (total[i + half + 1] - total[i - half]) / (2 * half + 1)[:, None]


SQRT2 = math.sqrt(2.0)
Cell = tuple[int, int]
"""Row and column."""


def astar(cost: Array, start: Cell, goal: Cell, beta: float, closed: float) -> tuple[NDArray[np.int64], float] | None:
    """Return the cheapest way, (n, 2) cells from start to goal, and the sum; None where there is no way.

    Args:
        cost: (rows, columns) C of each cell, not negative.
        start: first cell, inside; its own cost does not count.
        goal: last cell, inside.
        beta: weight of C against length, not negative.
        closed: cells with a cost of this and more cannot be entered.
    """
    rows, columns = cost.shape
    parents = np.full(rows * columns, -1, np.int32)
    here, at = start[0] * columns + start[1], goal[0] * columns + goal[1]
    total = _search(np.ascontiguousarray(cost, np.float64), here, at, float(beta), float(closed), parents)
    if not math.isfinite(total):
        return None
    way = []
    while at >= 0:
        way.append(divmod(at, columns))
        at = int(parents[at])
    return np.array(way[::-1], np.int64), total


@njit(cache=True, nogil=True, error_model="numpy")
def _search(cost: Array, start: int, goal: int, beta: float, closed: float, parents: NDArray[np.int32]) -> float:
    """Fill in the parent of every cell on the way (-1 for the start), and return the sum; infinite without a way."""
    rows, columns = cost.shape
    goal_row, goal_column = goal // columns, goal % columns
    spent = np.full(rows * columns, np.inf)
    done = np.zeros(rows * columns, np.bool_)
    # A binary heap of (estimate, cell); an entry that was improved on stays, and is passed over when it comes up.
    size, room = 0, 1024
    keys, items = np.empty(room), np.empty(room, np.int64)
    spent[start] = 0.0
    keys[0], items[0], size = 0.0, start, 1
    while size > 0:
        cell = items[0]
        size -= 1
        key, item, i = keys[size], items[size], 0
        while True:
            child = 2 * i + 1
            if child >= size:
                break
            if child + 1 < size and keys[child + 1] < keys[child]:
                child += 1
            if keys[child] >= key:
                break
            keys[i], items[i] = keys[child], items[child]
            i = child
        keys[i], items[i] = key, item
        if done[cell]:
            continue
        done[cell] = True
        if cell == goal:
            return spent[goal]
        row, column = cell // columns, cell % columns
        for dr in range(-1, 2):
            for dc in range(-1, 2):
                r, c = row + dr, column + dc
                if (dr == 0 and dc == 0) or r < 0 or r >= rows or c < 0 or c >= columns:
                    continue
                if cost[r, c] >= closed:
                    continue
                other = r * columns + c
                length = 1.0 if dr == 0 or dc == 0 else SQRT2
                through = spent[cell] + length + beta * cost[r, c]
                if done[other] or through >= spent[other]:
                    continue
                spent[other] = through
                parents[other] = cell
                if size == room:
                    room *= 2
                    more_keys, more_items = np.empty(room), np.empty(room, np.int64)
                    for i in range(size):
                        more_keys[i], more_items[i] = keys[i], items[i]
                    keys, items = more_keys, more_items
                estimate = through + math.sqrt(float((r - goal_row) ** 2 + (c - goal_column) ** 2))
                i = size
                size += 1
                while i > 0:
                    parent = (i - 1) // 2
                    if keys[parent] <= estimate:
                        break
                    keys[i], items[i] = keys[parent], items[parent]
                    i = parent
                keys[i], items[i] = estimate, other
    return np.inf
