"""Shapes and point clouds that a robot's spheres must not touch, in the base frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy import ndimage

from golem.capabilities.collision import world_kernel
from golem.capabilities.collision.world_kernel import Cells, Points, WorldTables
from golem.errors import ConfigError, unknown_name
from golem.types import Array

CELL = 0.02
"""Size of a cell of the cloud's grid [m]."""
LEAST = 3
"""Points that make a cell occupied: a stereo camera's stray ones come alone."""
ROBOT_MARGIN = 0.10
"""Points this near to the robot's own spheres are taken for the robot's [m]: a head camera that is off by 55 mm sees
the hand as far from where the joints, which are off by 35 mm, have it."""


def scene_world(points: Points, spheres: Array, spared: Sequence[tuple[Array, float]] = ()) -> World:
    """Return the world that a cloud shows.

    Args:
        points: (n, 3) in base_link [m]; those that are not finite or out of the hands' reach are dropped.
        spheres: (m, 4) of the robot in its present posture, in base_link [m]; see `CollisionModel.placed`.
        spared: what the hand is to go to: centres (3,) in base_link and radii [m].
    """
    kept = np.asarray(points, np.float64)
    kept = kept[((kept > REACH[0]) & (kept < REACH[1])).all(axis=1)]  # NaN fails every comparison
    for centre, radius in spared:
        off = kept - centre
        kept = kept[np.einsum("ij,ij->i", off, off) > radius**2]
    if len(kept):
        index = np.floor((kept - REACH[0]) / CELL).astype(np.int64)
        shape = np.ceil((REACH[1] - REACH[0]) / CELL).astype(np.int64) + 1
        flat = np.ravel_multi_index(tuple(index.T), tuple(shape))
        kept = kept[np.bincount(flat)[flat] >= LEAST]
    return World(cloud=cloud_grid(kept, CELL, spheres=spheres, margin=ROBOT_MARGIN))


def displaced(world: World, by: Array) -> World:
    """Return the world with its cloud moved by `by` (3,) [m]: what showed it is off by that much the other way."""
    if world.cloud is None:
        return world
    cloud = world.cloud
    step = np.append(by, 0.0)
    moved = CloudGrid(cloud.balls + step, cloud.cells, cloud.steps, cloud.frame + step, cloud.dropped)
    return World(world.obstacles, moved)


ObstacleKind = Literal["box", "cylinder", "sphere", "half_space"]
OBSTACLE_KINDS: tuple[ObstacleKind, ...] = ("box", "cylinder", "sphere", "half_space")
"""A cylinder's axis is its z. A half-space is solid below the plane z = 0 of its frame."""
SIZES = {"box": 3, "cylinder": 2, "sphere": 1, "half_space": 0}


@dataclass(frozen=True, slots=True)
class Obstacle:
    """A solid.

    Attributes:
        kind: one of `OBSTACLE_KINDS`.
        T_base_obstacle: (4, 4) pose of its frame.
        size: half extents of a box; radius and half height of a cylinder; radius of a sphere; nothing [m].
    """

    kind: ObstacleKind
    T_base_obstacle: Array
    size: tuple[float, ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        if self.kind not in OBSTACLE_KINDS:
            raise unknown_name("kind of obstacle", self.kind, OBSTACLE_KINDS)
        if len(self.size) != SIZES[self.kind] or not all(0.0 < x < np.inf for x in self.size):
            raise ConfigError(f"A {self.kind} has {SIZES[self.kind]} positive sizes in metres, not {list(self.size)}.")
        if np.shape(self.T_base_obstacle) != (4, 4) or not np.isfinite(self.T_base_obstacle).all():
            raise ConfigError(f"The pose of a {self.kind} is a finite 4x4 matrix.")


@dataclass(frozen=True, slots=True)
class CloudGrid:
    """A point cloud as one ball per occupied cell of a grid, so that the balls hold every point.

    Attributes:
        balls: (k, 4) mean of the points of a cell, and the distance of the farthest from it [m].
        cells: (x, y, z) index into `balls`, -1 where a cell is empty.
        steps: (x, y, z) cells to the nearest occupied one, diagonals counting one.
        frame: (4,) lower corner of the grid and size of a cell [m].
        dropped: points that were not finite or outside the grid.
    """

    balls: Array
    cells: Cells
    steps: Cells
    frame: Array
    dropped: int


REACH = np.array([[-0.5, -1.1, -0.9], [1.2, 1.1, 1.2]])
"""Opposite corners of what the hands of the H1-2 can reach, in base_link [m]."""


NOTHING: Array = np.zeros((0, 4))
"""No spheres."""


def cloud_grid(points: Points, cell: float = 0.02, spheres: Array = NOTHING, margin: float = 0.0) -> CloudGrid:
    """Return the grid of a cloud; 10 million points take about half a second.

    Args:
        points: (n, 3) in the base frame [m]; those that are not finite, or not within `REACH`, are dropped.
        cell: size of a cell [m].
        spheres: (m, 4) see `cleared`.
        margin: see `cleared` [m].

    Raises:
        ConfigError: `points` has another shape, or cells no size.
    """
    if np.ndim(points) != 2 or np.shape(points)[1] != 3:
        raise ConfigError(f"A cloud is an (n, 3) array of points, not {np.shape(points)}.")
    low, high = REACH
    if not cell > 0.0:
        raise ConfigError(f"The cells of a cloud's grid have a positive size, not {cell:g} m.")
    shape = np.ceil((high - low) / cell).astype(np.int64)
    frame = np.append(low, cell)
    if not points.flags.c_contiguous:
        points = points.copy()
    cells = np.full(tuple(shape), -1, np.int32)
    balls = np.zeros((world_kernel.number_cells(points, frame, cells), 4))
    kept = world_kernel.fill_balls(points, frame, cells, balls)
    balls, cells = _away(balls, cells, spheres, margin)
    return CloudGrid(balls, cells, cell_steps(cells), frame, len(points) - kept)


def cleared(grid: CloudGrid, spheres: Array, margin: float) -> CloudGrid:
    """Return the grid without the cells that are nearer than `margin` [m] to `spheres` (m, 4)."""
    balls, cells = _away(grid.balls, grid.cells, spheres, margin)
    return grid if balls is grid.balls else CloudGrid(balls, cells, cell_steps(cells), grid.frame, grid.dropped)


def _away(balls: Array, cells: Cells, spheres: Array, margin: float) -> tuple[Array, Cells]:
    """Return balls (k, 4) and cells without those that are nearer than `margin` [m] to `spheres` (m, 4)."""
    near = np.zeros(len(balls), bool)
    for sphere in spheres:
        off, reach = balls[:, :3] - sphere[:3], sphere[3] + margin + balls[:, 3]
        near |= np.einsum("ij,ij->i", off, off) < reach * reach
    if not near.any():
        return balls, cells
    left = np.flatnonzero(~near)
    renumbered = np.full(len(near) + 1, -1, np.int32)  # the last is that of empty cells, -1
    renumbered[left] = np.arange(len(left))
    return balls[left], renumbered[cells]


def cell_steps(cells: Cells) -> Cells:
    """Return how many cells away from each cell the nearest is that is not empty, -1; diagonals count one."""
    steps = np.full(cells.shape, 255, np.int32)
    if (cells >= 0).any():
        ndimage.distance_transform_cdt(cells < 0, metric="chessboard", distances=steps)
    return steps


class World:
    """What stands around the robot: shapes, and at most one cloud."""

    def __init__(self, obstacles: Sequence[Obstacle] = (), cloud: CloudGrid | None = None) -> None:
        self.obstacles, self.cloud = tuple(obstacles), cloud
        self.shapes: Array = np.zeros((len(self.obstacles), 16))
        for row, obstacle in zip(self.shapes, self.obstacles, strict=True):
            row[0] = OBSTACLE_KINDS.index(obstacle.kind)
            row[1:10] = obstacle.T_base_obstacle[:3, :3].ravel()
            row[10:13] = obstacle.T_base_obstacle[:3, 3]
            row[13 : 13 + len(obstacle.size)] = obstacle.size
        c = cloud or _NO_CLOUD
        self.tables = WorldTables(self.shapes, c.balls, c.cells, c.steps, c.frame)

    def distance(self, balls: Array, cutoff: float = 0.2) -> tuple[Array, Array]:
        """Return how near balls are to the nearest solid.

        Args:
            balls: (n, 4) centre in the base and radius [m].
            cutoff: distance beyond which nothing is looked for [m].

        Returns:
            (n,) distance between surfaces, negative inside, `cutoff` where nothing is near [m]; (n, 3) unit direction
            in which it grows fastest, zero where nothing is near.
        """
        distance, direction = np.empty(len(balls)), np.empty((len(balls), 3))
        balls = np.ascontiguousarray(balls, float)
        world_kernel.ball_distances(balls, self.tables, cutoff, distance, direction)
        return distance, direction


_NO_CLOUD = CloudGrid(
    np.zeros((0, 4)), np.zeros((0, 0, 0), np.int32), np.zeros((0, 0, 0), np.int32), np.array([0.0, 0.0, 0.0, 1.0]), 0
)
