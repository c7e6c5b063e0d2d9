"""The pack from above, near edge at the bottom: what became of each fastener, the stops that are planned, the robot."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.skills.fastener_list import Listed
from golem.skills.job_file import Fate, PackFastener
from golem.skills.pack_plan import PackStop
from golem.types import Array, PlanarPose

Colour = tuple[int, int, int]
COLOURS: dict[Fate, Colour] = {
    Fate.IN_TRAY: (34, 170, 34),
    Fate.OPEN: (136, 136, 136),
    Fate.TRYING: (255, 140, 0),
    Fate.TIGHT: (204, 136, 0),
    Fate.JAMMED: (204, 136, 0),
}
OTHER: Colour = (204, 34, 34)
"""RGB of the fates, and of those that are not there."""
TRAY, STOP, ROBOT, GANTRY, PAPER = (0, 150, 190), (0, 120, 200), (255, 140, 0), (150, 60, 180), (250, 250, 250)
SCALE, MARGIN = 170.0, 0.75
"""Pixels per metre, and floor around the fasteners that is shown [m]."""


def pack_picture(
    fasteners: Sequence[PackFastener],
    trays: Sequence[Listed],
    stops: Sequence[PackStop],
    robot: PlanarPose,
    gantry: Array | None,
) -> NDArray[np.uint8]:
    """Return (height, width, 3) RGB of at least one fastener, of trays, and of the stops in their order.

    The `robot` is base_link in the pack frame, `gantry` (2,) is where it works there [m], or None.
    """
    places = np.array([one.place[:2] for one in fasteners])
    low, high = places.min(axis=0) - MARGIN, places.max(axis=0) + MARGIN
    width, height = (round(SCALE * float(high[k] - low[k])) for k in (1, 0))
    image = np.full((height, width, 3), PAPER, np.uint8)

    def pixel(x: float, y: float) -> tuple[int, int]:
        return round(SCALE * (float(high[1]) - y)), round(SCALE * (float(high[0]) - x))

    for tray in trays:
        cv2.circle(image, pixel(tray.x, tray.y), 13, TRAY, 2, cv2.LINE_AA)
    way = [pixel(stop.pose.x, stop.pose.y) for stop in stops]
    for number, at in enumerate(way, 1):
        cv2.circle(image, at, 9, STOP, 1, cv2.LINE_AA)
        cv2.putText(image, str(number), (at[0] - 4, at[1] + 4), cv2.FONT_HERSHEY_SIMPLEX, 0.35, STOP, 1, cv2.LINE_AA)
    for one in fasteners:
        cv2.circle(image, pixel(one.listed.x, one.listed.y), 4, COLOURS.get(one.fate, OTHER), -1, cv2.LINE_AA)
    if gantry is not None:
        cv2.drawMarker(image, pixel(*gantry.tolist()), GANTRY, cv2.MARKER_CROSS, 16, 2)
    tip = robot @ PlanarPose(0.3, 0.0, 0.0)
    cv2.arrowedLine(image, pixel(robot.x, robot.y), pixel(tip.x, tip.y), ROBOT, 2, cv2.LINE_AA, tipLength=0.4)
    return image
