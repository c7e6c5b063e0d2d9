"""A picture of a walk from above: the robot's map, the way it meant to go, where it really went, and the goal."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.interfaces.nav_payloads import OccupancyGrid
from golem.types import Array, PlanarPose

SCALE = 3
"""Pixels per cell."""
_GREY, _WHITE, _BLACK = 150, 245, 40
_WAY, _TRACK, _GOAL = (200, 120, 0), (0, 0, 220), (0, 150, 0)


def floor_picture(grid: OccupancyGrid, way: Array | None, track: Array, goal: PlanarPose) -> bytes:
    """Return a PNG, x upwards and y to the left.

    Args:
        grid: the map.
        way: (n, 2) the way that the navigator last meant to go, in the frame of the map [m].
        track: (n, 2) where the robot went [m].
        goal: where to.
    """
    shade = np.where(grid.cells < 0, _GREY, np.where(grid.cells > 50, _BLACK, _WHITE)).astype(np.uint8)
    image = cv2.cvtColor(
        cv2.resize(shade, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_NEAREST), cv2.COLOR_GRAY2BGR
    )
    image = np.ascontiguousarray(image)

    def pixels(points: Array) -> NDArray[np.int32]:
        local = [grid.origin.to(PlanarPose(float(x), float(y), 0.0)) for x, y in points]
        return (np.array([[p.x, p.y] for p in local]) / grid.resolution * SCALE).astype(np.int32)

    for line, colour in ((way, _WAY), (track, _TRACK)):
        if line is not None and len(line) > 1:
            cv2.polylines(image, [pixels(line)], False, colour, 2)
    tip = goal @ PlanarPose(0.5, 0.0, 0.0)
    a, b = pixels(np.array([[goal.x, goal.y], [tip.x, tip.y]]))
    cv2.arrowedLine(image, a.tolist(), b.tolist(), _GOAL, 2, tipLength=0.4)
    cv2.circle(image, a.tolist(), 5, _GOAL, -1)
    turned = cv2.rotate(image, cv2.ROTATE_90_COUNTERCLOCKWISE)[:, ::-1]
    return cv2.imencode(".png", turned)[1].tobytes()
