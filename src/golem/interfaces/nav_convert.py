"""Maps and ways as messages of ROS 2."""

from __future__ import annotations

import math

import numpy as np

from golem.interfaces.nav_payloads import NavPath, OccupancyGrid
from golem.interfaces.ros_convert import header, matrix, pose, seconds, time
from golem.middleware.ros.msgs import nav_msgs
from golem.middleware.ros.msgs.geometry_msgs import PoseStamped
from golem.types import PlanarPose

MAP_FRAME = "map"
"""Frame of the map."""


def occupancy_grid(grid: OccupancyGrid) -> nav_msgs.OccupancyGrid:
    """Return a map in its own frame."""
    rows, columns = grid.cells.shape
    origin = pose(grid.in_map.origin.matrix())
    info = nav_msgs.MapMetaData(time(grid.t), grid.resolution, columns, rows, origin)
    return nav_msgs.OccupancyGrid(header(grid.t, MAP_FRAME), info, grid.cells.ravel().astype(np.int8))


def to_occupancy_grid(message: nav_msgs.OccupancyGrid) -> OccupancyGrid:
    """Return a map as it was told, in its own frame."""
    info = message.info
    cells = np.asarray(message.data, np.int8).reshape(info.height, info.width)
    return OccupancyGrid(seconds(message.header.stamp), PlanarPose.of(matrix(info.origin)), info.resolution, cells)


def path(way: NavPath) -> nav_msgs.Path:
    """Return a way; each pose heads to the next."""
    steps = np.diff(way.points, axis=0)
    headings = [math.atan2(y, x) for x, y in steps.tolist()]
    headings += headings[-1:] or [0.0]
    stamp = header(way.t, way.frame)
    poses = [
        PoseStamped(stamp, pose(PlanarPose(x, y, yaw).matrix()))
        for (x, y), yaw in zip(way.points.tolist(), headings, strict=False)
    ]
    return nav_msgs.Path(stamp, poses)
