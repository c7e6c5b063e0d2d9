"""A picture of the floor from above, for people: the map, the way, the scan, where the robot went, and its goal."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from golem.interfaces.nav_payloads import OccupancyGrid
from golem.types import Array, PlanarPose

Colour = tuple[int, int, int]
UNKNOWN, FREE, FULL = 150, 245, 40
INK, FAINT = (20, 20, 20), (150, 150, 190)
WAY, TRACK, GOAL, ROBOT, SCAN = (0, 120, 200), (220, 0, 0), (0, 150, 0), (255, 140, 0), (230, 0, 180)
FONT, LETTERS = cv2.FONT_HERSHEY_SIMPLEX, 0.38
HALO = (245, 245, 245)
"""Behind words and dots, so that they can be read on walls and on what is not known."""
STEPS = (0, 1, -1, 2, -2, 3, -3, 4, -4)
"""Lines by which words give way to others, in this order."""
Box = tuple[int, int, int, int]
EDGE = 8
"""Cells around what is known that are shown."""


class MapPicture:
    """One picture, x upwards and y to the left; everything is given in the frame of the map's origin."""

    def __init__(self, grid: OccupancyGrid, scale: int = 3) -> None:
        """Draw the part of a map that is known, with `scale` pixels per cell."""
        known = np.argwhere(grid.cells >= 0)
        low = known.min(axis=0) if len(known) else np.zeros(2, int)
        high = known.max(axis=0) + 1 if len(known) else np.array(grid.cells.shape)
        low = np.maximum(low - EDGE, 0)
        high = np.minimum(high + EDGE, grid.cells.shape)
        cells = grid.cells[low[0] : high[0], low[1] : high[1]]
        shade = np.where(cells < 0, UNKNOWN, np.where(cells > 50, FULL, FREE)).astype(np.uint8)
        large = cv2.resize(shade, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
        self._image = np.ascontiguousarray(cv2.cvtColor(large, cv2.COLOR_GRAY2RGB))
        self._grid, self._low, self._scale = grid, low[::-1], scale
        self._marks: list[tuple[Array, str, Colour]] = []

    def line(self, points: Array, colour: Colour) -> None:
        """Draw a line through places (n, 2) [m]."""
        if len(points) > 1:
            cv2.polylines(self._image, [self._pixels(points)], False, colour, 2)

    def dots(self, points: Array, colour: Colour) -> None:
        """Draw places (n, 2) [m]."""
        rows, columns = self._image.shape[:2]
        x, y = self._pixels(points).T
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        self._image[y[inside], x[inside]] = colour

    def pose(self, pose: PlanarPose, colour: Colour) -> None:
        """Draw a pose as an arrow of half a metre."""
        tip = pose @ PlanarPose(0.5, 0.0, 0.0)
        a, b = self._pixels(np.array([[pose.x, pose.y], [tip.x, tip.y]]))
        cv2.arrowedLine(self._image, a.tolist(), b.tolist(), colour, 2, tipLength=0.4)
        cv2.circle(self._image, a.tolist(), 5, colour, -1)

    def mark(self, place: Array, text: str, colour: Colour) -> None:
        """Mark a place (2,) [m] with a few words beside it; those of the last one are nearest to their place."""
        self._marks.append((place, text, colour))

    def rgb(self) -> NDArray[np.uint8]:
        """Return the picture, (height, width, 3)."""
        picture = np.ascontiguousarray(cv2.rotate(self._image, cv2.ROTATE_90_COUNTERCLOCKWISE)[:, ::-1], np.uint8)
        height, width = picture.shape[:2]
        taken: list[Box] = []
        drawn: list[tuple[tuple[int, int], tuple[int, int], str, Colour]] = []
        for place, text, colour in reversed(self._marks):  # words are written upright, so after the turn
            x, y = self._pixels(place[np.newaxis])[0].tolist()
            column, row = width - 1 - y, height - 1 - x
            (wide, high), _ = cv2.getTextSize(text, FONT, LETTERS, 1)
            left = column + 7 if column + 7 + wide < width else column - 7 - wide
            rows = [row + 4 + step * (high + 4) for step in STEPS]
            bottom = next(
                (r for r in rows if high <= r < height and _free((left, r - high, left + wide, r), taken)), rows[0]
            )
            taken.append((left, bottom - high, left + wide, bottom))
            cv2.rectangle(picture, (left - 1, bottom - high - 1), (left + wide, bottom + 2), HALO, -1)
            drawn.append(((column, row), (left, bottom), text, colour))
            cv2.circle(picture, (column, row), 6, HALO, -1)
        for dot, corner, text, colour in reversed(drawn):
            cv2.circle(picture, dot, 4, colour, -1)
            cv2.putText(picture, text, corner, FONT, LETTERS, colour, 1, cv2.LINE_AA)
        return picture

    def _pixels(self, points: Array) -> NDArray[np.int32]:
        o = self._grid.origin
        c, s = np.cos(o.yaw), np.sin(o.yaw)
        local = (points - (o.x, o.y)) @ np.array([[c, -s], [s, c]]) / self._grid.resolution - self._low
        return (np.clip(local, -1e4, 1e4) * self._scale).astype(np.int32)


def _free(box: Box, taken: list[Box]) -> bool:
    """Return whether a box (left, top, right, bottom) [px] overlaps none of `taken`."""
    left, top, right, bottom = box
    return all(right < a or c < left or bottom < b or d < top for a, b, c, d in taken)
