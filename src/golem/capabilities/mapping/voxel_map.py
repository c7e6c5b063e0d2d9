"""A voxel map that grows with what is seen, and the map of the floor below it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.mapping import voxel_kernel
from golem.types import Array

MARGIN = 4.0
"""By how much more than is needed the map grows at once [m]."""
BELOW, ABOVE = 0.4, 2.2
"""How far the map reaches below and above the floor [m]."""
LARGEST = 400.0
"""Side that a map may have at most [m]: more is a scan of somewhere else."""


class VoxelMap:
    """Log odds on a grid that is aligned with odom.

    Attributes:
        resolution: side of a voxel and of a cell [m].
        band: lowest and highest height above the floor at which something is in the robot's way [m].
        voxels: (rows, columns, layers) see `voxel_kernel`; empty before the first scan.
        cells: (rows, columns) the map of the floor, see `OccupancyGrid`.
        corner: (3,) corner of voxel [0, 0, 0] in odom [m].
    """

    def __init__(self, resolution: float, band: tuple[float, float]) -> None:
        """Begin with nothing."""
        self.resolution, self.band = resolution, band
        self.voxels: voxel_kernel.Voxels = np.zeros((0, 0, 0), np.int8)
        self.cells: NDArray[np.int8] = np.zeros((0, 0), np.int8)
        self.corner: Array = np.zeros(3)
        self._stamps: voxel_kernel.Stamps = np.zeros((0, 0, 0), np.uint16)
        self._number = 0
        self._changed: NDArray[np.int64] | None = None

    @property
    def empty(self) -> bool:
        """Whether nothing was ever seen."""
        return self.voxels.size == 0

    def add(self, points: Array, origin: Array, floor: Array, every: int) -> None:
        """Take one scan.

        Args:
            points: (n, 3) in odom, finite, within the range that counts [m].
            origin: (3,) of the sensor [m].
            floor: (3,) plane of the floor, see `FloorPlane`.
            every: of so many points one clears the way to it.
        """
        low, high = voxel_kernel.span(points, origin)
        if len(points) == 0 or not self._reach(low, high, float(floor[2])):
            return
        self._number = self._number % 65535 + 1
        box = self._box(low, high)
        arguments = self.corner, self.resolution, self._number
        voxel_kernel.mark(self.voxels, self._stamps, points, *arguments)
        voxel_kernel.clear(self.voxels, self._stamps, points[self._number % every :: every], origin, *arguments)
        old = box if self._changed is None else self._changed
        self._changed = np.array([min(box[0], old[0]), max(box[1], old[1]), min(box[2], old[2]), max(box[3], old[3])])

    def flatten(self, floor: Array) -> NDArray[np.int8]:
        """Bring `cells` up to date, by the plane of the floor (3,), and return them."""
        if self._changed is not None:
            voxel_kernel.flatten(
                self.voxels, self.cells, self._changed, self.corner, self.resolution, floor, np.array(self.band)
            )
            self._changed = None
        return self.cells

    def occupied(self) -> Array:
        """Return the (n, 3) middles of the occupied voxels in odom [m]."""
        r, c, k = np.nonzero(self.voxels >= voxel_kernel.OCCUPIED)
        return self.corner + (np.column_stack([c, r, k]) + 0.5) * self.resolution

    def _box(self, low: Array, high: Array) -> NDArray[np.int64]:
        """Return first and last row and column, the last exclusive, that rays from `low` to `high` (2,) may change."""
        first = np.floor((low - self.corner[:2]) / self.resolution).astype(np.int64)
        last = np.floor((high - self.corner[:2]) / self.resolution).astype(np.int64) + 1
        rows, columns, _ = self.voxels.shape
        return np.array([max(0, first[1]), min(rows, last[1]), max(0, first[0]), min(columns, last[0])], np.int64)

    def _reach(self, low: Array, high: Array, floor: float) -> bool:
        """Grow until everything from `low` to `high` (2,) is inside; return whether it is."""
        layers = round((BELOW + ABOVE) / self.resolution)
        if self.empty:
            self.corner = np.array([*(np.floor((low - MARGIN) / self.resolution) * self.resolution), 0.0])
            self.corner[2] = floor - BELOW
            size = np.ceil((high + MARGIN - self.corner[:2]) / self.resolution).astype(int)
            if size.max() * self.resolution > LARGEST:
                return False
            shape = (int(size[1]), int(size[0]))
            self.voxels, self._stamps = (np.zeros((*shape, layers), np.int8), np.zeros((*shape, layers), np.uint16))
            self.cells = np.full(shape, voxel_kernel.UNKNOWN, np.int8)
            return True
        rows, columns, _ = self.voxels.shape
        top = self.corner[:2] + self.resolution * np.array([columns, rows])
        before = np.where(low < self.corner[:2], np.ceil((self.corner[:2] - low + MARGIN) / self.resolution), 0)
        after = np.where(high >= top, np.ceil((high - top + MARGIN) / self.resolution), 0)
        (c0, r0), (c1, r1) = before.astype(int), after.astype(int)
        if not (r0 or r1 or c0 or c1):
            return True
        if max(rows + r0 + r1, columns + c0 + c1) * self.resolution > LARGEST:
            return False
        wider = ((r0, r1), (c0, c1), (0, 0))
        self.voxels, self._stamps = np.pad(self.voxels, wider), np.pad(self._stamps, wider)
        self.cells = np.pad(self.cells, wider[:2], constant_values=voxel_kernel.UNKNOWN)
        self.corner = self.corner - self.resolution * np.array([c0, r0, 0])
        if self._changed is not None:
            self._changed = self._changed + np.array([r0, r0, c0, c0])
        return True
