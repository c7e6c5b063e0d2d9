"""What a camera's cloud says about the world: without the robot itself, stray points, and what is spared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from golem.capabilities.collision.obstacles import REACH, CloudGrid, World, cloud_grid
from golem.capabilities.collision.world_kernel import Points
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
