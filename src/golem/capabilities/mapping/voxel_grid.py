"""The mapper `grid`: voxels from every scan, the map of the floor from the voxels, the place in a map from before."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.mapping import voxel_kernel
from golem.capabilities.mapping.map_file import StoredMap, load_map
from golem.capabilities.mapping.scan_match import Landmarks, Match
from golem.capabilities.mapping.voxel_kernel import FREE, FULL
from golem.interfaces.nav_payloads import OccupancyGrid, Scan
from golem.options import require
from golem.types import Array, PlanarPose

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


FEWEST_IN_CELL = 4
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
        good = self._sums[self._sums[:, 2] >= FEWEST_IN_CELL]
        return good[:, :2] / good[:, 2:]


LATE = 5.0
"""Time by which a scan may be ahead of the one before [s]: more is another clock, unless the next one follows it."""
FIT = 0.6
"""Share of a scan's points that must be where the map has something for its place to count as found."""
FAR_OFF = 0.3
"""Correction above which a match is taken for a mistake while the robot is being followed [m]."""
UPRIGHT = (0.3, 2.0)
"""Heights above the floor between which points are compared with a map from before [m]."""
EVERY = 0.3
"""Time between two scans whose points are kept to be compared with later [s]."""
FEWEST = 200
"""Points that a scan must have to be looked for."""


@dataclass(frozen=True, slots=True)
class GridConfig:
    """Options of the mapper `grid`.

    Attributes:
        resolution: side of a voxel [m].
        reach: distance from the sensor up to which points count [m].
        band: lowest and highest height above the floor at which something is in the robot's way [m].
        rays: of so many points one clears the way to it.
        file: a map from before, `PATH.yaml` as ROS's map_server has it; empty for none.
        guess: where base_link roughly is in that map when the run begins: x, y [m], heading [rad].
        around: how far off the guess may be: [m], [rad].
        follow: time between two corrections of the place in that map [s].
        gain: share of a correction that is made.
    """

    resolution: float = 0.05
    reach: float = 10.0
    band: tuple[float, float] = (0.12, 1.9)
    rays: int = 4
    file: str = ""
    guess: tuple[float, float, float] = (0.0, 0.0, 0.0)
    around: tuple[float, float] = (0.8, 0.4)
    follow: float = 1.0
    gain: float = 0.3

    def __post_init__(self) -> None:
        low, high = self.band
        require(
            "mapper option ",
            ("resolution", self.resolution, 0.01 <= self.resolution <= 0.5, "from 0.01 to 0.5 m"),
            ("reach", self.reach, 0.5 <= self.reach <= 100.0, "from 0.5 to 100 m"),
            ("band", high, 0.0 < low < high <= 2.2, "two heights, the lower first, of at most 2.2 m"),
            ("rays", self.rays, self.rays >= 1, "at least 1"),
            ("around", max(self.around), 0.0 <= min(self.around) and max(self.around) <= 5.0, "at most 5 m and rad"),
            ("follow", self.follow, self.follow > 0.0, "a positive time in seconds"),
            ("gain", self.gain, 0.0 <= self.gain <= 1.0, "a share from 0 to 1"),
            ("guess", sum(self.guess), all(map(math.isfinite, self.guess)), "three finite numbers"),
        )


class VoxelGridMapper:
    """Voxels of what was seen, and the map of the floor from them; see `Mapper`. A scan costs some milliseconds.

    The map from before is `before`; None where the options name none.
    """

    rate = 2.0

    def __init__(self, config: GridConfig | None = None) -> None:
        """Read the map from before, if there is one. Raises ConfigError: it cannot be read."""
        self.config = config or GridConfig()
        self.before = load_map(Path(self.config.file)) if self.config.file else None
        self._marks: Landmarks | None = None
        if self.before is not None:
            self._marks = Landmarks(_landmarks(self.before))
        self.reset()

    @property
    def T_odom_map(self) -> PlanarPose | None:
        return self._T_odom_map if self._located or self.before is None else None

    def reset(self) -> None:
        self.voxels = VoxelMap(self.config.resolution, self.config.band)
        self.walls = WallMeans(self.config.resolution)
        self.floor: Array | None = None
        self._summed = -math.inf
        self._T_odom_map = PlanarPose(0.0, 0.0, 0.0)
        self._located = False
        self._t = self._ahead = -math.inf
        self._followed = -math.inf
        self._newest: Array = np.zeros((0, 2))

    def add_scan(self, scan: Scan) -> None:
        ahead = -math.inf < self._t and not scan.t < self._t + LATE
        follows = 0.0 < scan.t - self._ahead < LATE
        self._ahead = scan.t if ahead else -math.inf
        if not self._t < scan.t or (ahead and not follows) or not np.isfinite([*scan.origin, *scan.floor]).all():
            return
        points = np.asarray(scan.points, np.float64)
        points = voxel_kernel.within(points, np.asarray(scan.origin, np.float64), self.config.reach)
        self._t = scan.t
        self.floor = plane = scan.floor
        self.voxels.add(points, np.asarray(scan.origin, np.float64), plane, self.config.rays)
        height = points[:, 2] - points[:, :2] @ plane[:2] - plane[2]
        upright = points[(height > UPRIGHT[0]) & (height < UPRIGHT[1]), :2]
        if self.before is None and scan.t >= self._summed + EVERY:
            self._summed = scan.t
            self.walls.add(upright)
        self._newest = upright[:: max(1, len(upright) // 800)]
        self._follow(PlanarPose(float(scan.origin[0]), float(scan.origin[1]), 0.0))

    def grid(self) -> OccupancyGrid | None:
        if self.voxels.empty or self.floor is None or self.T_odom_map is None:
            return None
        cells = self.voxels.flatten(self.floor)
        if self.before is not None:
            return self._overlaid(self.before)
        corner = PlanarPose(float(self.voxels.corner[0]), float(self.voxels.corner[1]), 0.0)
        return OccupancyGrid(self._t, corner, self.config.resolution, cells.copy())

    def locate(self, guess: PlanarPose) -> str:
        """Look for the robot's place in the map from before; see `Mapper`. `guess` is where odom's origin is in it."""
        if self._marks is None:
            return "There is no map from before; give the mapper one with its option file."
        if len(self._newest) < FEWEST:
            return "No scan with enough points has come yet."
        few = self._newest[:: max(1, len(self._newest) // 200)]
        match = self._marks.refine(self._newest, self._marks.search(few, guess, self.config.around))
        if match.share < FIT:
            return (
                f"Only {100 * match.share:.0f} % of the scan fits the map near ({guess.x:.1f}, {guess.y:.1f}); "
                "give a better guess, or another map."
            )
        self._place(match, 1.0)
        return ""

    def stored(self) -> StoredMap | None:
        grid = self.grid()
        if grid is None:
            return None
        places = self.walls.places() if self.before is None else self.before.walls
        own = grid.in_map
        voxels = self.voxels.occupied()
        back = self._T_odom_map.to(PlanarPose(0.0, 0.0, 0.0)).matrix()
        return StoredMap(own.origin, own.resolution, own.cells, voxels @ back[:3, :3].T + back[:3, 3], places)

    def _follow(self, here: PlanarPose) -> None:
        """Find the place in the map from before at first, and correct it from time to time; the robot is `here`."""
        if self._marks is None or self._t - self._followed < self.config.follow or len(self._newest) < FEWEST:
            return
        self._followed = self._t
        if not self._located:
            # At the start base_link is at odom's origin.
            self.locate(PlanarPose(*self.config.guess))
            return
        T_map_odom = self._T_odom_map.to(PlanarPose(0.0, 0.0, 0.0))
        match = self._marks.refine(self._newest, T_map_odom)
        off = (T_map_odom @ here).to(match.pose @ here)
        if match.share >= FIT and math.hypot(off.x, off.y) < FAR_OFF and abs(off.yaw) < 0.1:
            self._place(match, self.config.gain)

    def _place(self, match: Match, share: float) -> None:
        """Go `share` of the way to where a scan in odom fits into the map."""
        origin = PlanarPose(0.0, 0.0, 0.0)
        self._T_odom_map, self._located = self._T_odom_map.to(origin).toward(match.pose, share).to(origin), True

    def _overlaid(self, stored: StoredMap) -> OccupancyGrid:
        """Return the map from before with what this run saw drawn into it."""
        cells = stored.cells.copy()
        live = self.voxels.cells
        corner = PlanarPose(float(self.voxels.corner[0]), float(self.voxels.corner[1]), 0.0)
        T = (self._T_odom_map @ stored.origin).to(corner)
        cos, sin = math.cos(T.yaw), math.sin(T.yaw)
        for value in (FREE, FULL):
            r, c = np.nonzero(live == value)
            at = (np.column_stack([c, r]) + 0.5) * self.config.resolution
            at = at @ np.array([[cos, sin], [-sin, cos]]) + (T.x, T.y)
            column, row = np.floor(at / stored.resolution).astype(int).T
            inside = (row >= 0) & (row < cells.shape[0]) & (column >= 0) & (column < cells.shape[1])
            cells[row[inside], column[inside]] = value
        T = self._T_odom_map
        return OccupancyGrid(self._t, T @ stored.origin, stored.resolution, cells, T)


def _landmarks(stored: StoredMap) -> Array:
    """Return the (n, 2) places that scans are compared with: of a file without any, the occupied cells."""
    if len(stored.walls):
        return stored.walls
    r, c = np.nonzero(stored.cells > 50)
    cells = (np.column_stack([c, r]) + 0.5) * stored.resolution
    cos, sin = math.cos(stored.origin.yaw), math.sin(stored.origin.yaw)
    turned = cells @ np.array([[cos, sin], [-sin, cos]]) + (stored.origin.x, stored.origin.y)
    return np.asarray(turned, np.float64) if len(turned) else np.zeros((1, 2))
