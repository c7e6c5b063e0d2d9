"""The map of a running stack as a picture: the way, the newest scan, what is remembered, and where the robot is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from golem.capabilities.navigation.map_picture import FAINT, INK, ROBOT, SCAN, WAY, MapPicture
from golem.interfaces import topics
from golem.interfaces.memory_payloads import RememberedPlace
from golem.middleware.bus import Bus
from golem.types import PlanarPose


def map_view(bus: Bus) -> NDArray[np.uint8] | None:
    """Return (height, width, 3) RGB; None in a stack without a map."""
    grid, place, odometry = (bus.latest(topics.MAP), bus.latest(topics.MAP_POSE), bus.latest(topics.ODOMETRY))
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
    known = bus.latest(topics.MEMORY_PLACES)
    if known is not None and known.frame == "map":
        for one in reversed(known.places):  # what was seen last is drawn over the rest
            at = np.array([one.x, one.y])
            picture.mark(at, place_words(one), INK if one.there else FAINT)
    picture.pose(T_map_odom @ PlanarPose.of(odometry.T_odom_base), ROBOT)
    return picture.rgb()


def place_words(place: RememberedPlace) -> str:
    """Return what is written beside a place: what is there, and how long ago it was seen, or that it is gone."""
    age = place.age
    ago = f"{age:.0f} s" if age < 120.0 else f"{age / 60.0:.0f} min" if age < 7200.0 else f"{age / 3600.0:.0f} h"
    return f"{place.label} {ago}" if place.there else f"{place.label}, gone"
