"""Where upright surfaces are, finer than the cells of a map: the mean of all points that fell into a cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.types import Array

FEWEST = 4
"""Points in a cell from which on their mean counts."""
SPAN = 1 << 20
"""Cells along an axis that have numbers of their own; a map is far smaller."""


class WallMeans:
    """Sums of points by cell of the floor."""

    def __init__(self, cell: float) -> None:
        """Sum up in cells of side `cell` [m]."""
        self._cell = cell
        self._keys: NDArray[np.int64] = np.zeros(0, np.int64)
        self._sums: Array = np.zeros((0, 3))

    def add(self, points: Array) -> None:
        """Take (n, 2) points of upright surfaces [m]."""
        cells = np.floor(points / self._cell).astype(np.int64)
        keys = cells[:, 0] * SPAN + cells[:, 1]
        rows = np.column_stack([points, np.ones(len(points))])
        every, where = np.unique(np.concatenate([self._keys, keys]), return_inverse=True)
        stacked = np.concatenate([self._sums, rows])
        sums = [np.bincount(where, stacked[:, a], minlength=len(every)) for a in range(3)]
        self._sums = np.asarray(np.column_stack(sums), np.float64)
        self._keys = every

    def places(self) -> Array:
        """Return the (n, 2) means of the cells with enough points [m]."""
        good = self._sums[self._sums[:, 2] >= FEWEST]
        return good[:, :2] / good[:, 2:]
