"""The map of a running stack as a picture: with the way, the newest scan and where the robot believes to be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.navigation.map_picture import ROBOT, SCAN, WAY, MapPicture
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.types import PlanarPose


def map_view(bus: Bus) -> NDArray[np.uint8] | None:
    """Return (height, width, 3) RGB; None in a stack without a map."""
    grid, place, odometry = (
        bus.latest(topics.MAP),
        bus.latest(topics.MAP_POSE),
        bus.latest(topics.ODOMETRY),
    )
    if grid is None or place is None or odometry is None:
        return None
    T_map_odom = place.T_odom_map.to(PlanarPose(0.0, 0.0, 0.0))
    picture = MapPicture(grid.in_map, 2)
    scan, way = bus.latest(topics.SCAN), bus.latest(topics.NAV_PATH)
    if scan is not None:
        seen = scan.seen_from(T_map_odom)
        height = seen.heights
        picture.dots(seen.points[(height > 0.12) & (height < 1.9), :2][::4], SCAN)
    if way is not None and way.frame == "map":
        picture.line(way.points, WAY)
    picture.pose(T_map_odom @ PlanarPose.of(odometry.T_odom_base), ROBOT)
    return picture.rgb()
