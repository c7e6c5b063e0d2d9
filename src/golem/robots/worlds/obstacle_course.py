"""Walls and obstacles in the lane of the furnished hall, drawn from a seed, with a way left between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from golem.types import Array

AREA = (1.8, 4.3, -2.4, 2.6)
"""x and y bounds of where obstacles stand [m]."""
WAY = 0.75
"""Distance from obstacles that a way from start to goal has everywhere [m]: the robot's half width and some more."""
START, GOAL = (0.0, 0.0), (6.0, 0.0)
"""Places between which there is a way [m]."""
TRIES = 400
CELL = 0.05


@dataclass(frozen=True, slots=True)
class CourseObstacle:
    """A box, or an upright cylinder, on the floor.

    Attributes:
        place: (2,) x, y of its middle [m].
        size: (3,) half sides of a box [m]; radius, radius and half height of a cylinder.
        yaw: heading of a box [rad].
        round: whether it is a cylinder.
    """

    place: Array
    size: Array
    yaw: float
    round: bool


def draw_course(rng: np.random.Generator, count: int) -> tuple[CourseObstacle, ...]:
    """Return `count` obstacles, fewer where no more fit with a way left between: walls, boxes and posts."""
    placed: list[CourseObstacle] = []
    for _ in range(TRIES):
        if len(placed) == count:
            break
        one = _draw(rng, wall=not placed)
        if passable([*placed, one]):
            placed.append(one)
    return tuple(placed)


def passable(obstacles: Sequence[CourseObstacle]) -> bool:
    """Return whether a way leads from `START` to `GOAL` that is `WAY` from every obstacle."""
    x0, x1, y0, y1 = -0.8, 7.0, -3.4, 3.6
    free = np.full((round((y1 - y0) / CELL), round((x1 - x0) / CELL)), 255, np.uint8)
    for one in obstacles:
        corners = (outline(one) - (x0, y0)) / CELL
        cv2.fillConvexPoly(free, np.round(corners).astype(np.int32), 0)
    clear = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_PRECISE) * CELL >= WAY
    count, label = cv2.connectedComponents(clear.astype(np.uint8))
    start, goal = (label[round((y - y0) / CELL), round((x - x0) / CELL)] for x, y in (START, GOAL))
    return count > 1 and start != 0 and start == goal


def outline(one: CourseObstacle) -> Array:
    """Return the (n, 2) corners of an obstacle on the floor [m]."""
    if one.round:
        turns = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
        return one.place + one.size[0] * np.column_stack([np.cos(turns), np.sin(turns)])
    c, s = np.cos(one.yaw), np.sin(one.yaw)
    corners = one.size[:2] * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return one.place + corners @ np.array([[c, s], [-s, c]])


def _draw(rng: np.random.Generator, wall: bool) -> CourseObstacle:
    """Draw one obstacle; the first is a wall across the lane, so that no straight line leads to the goal."""
    kind = 0 if wall else int(rng.integers(0, 4))
    x0, x1, y0, y1 = AREA
    place = rng.uniform((x0, y0), (x1, y1))
    if kind == 0:
        half = rng.uniform(0.5, 1.0)
        if wall:
            place = np.array([rng.uniform(2.4, 4.0), rng.uniform(-0.5, 0.5)])
        yaw = np.pi / 2 + rng.uniform(-0.4, 0.4)
        return CourseObstacle(place, np.array([half, 0.06, rng.uniform(0.5, 1.1)]), float(yaw), False)
    if kind == 1:
        size = rng.uniform((0.15, 0.15, 0.12), (0.4, 0.4, 0.6))
        return CourseObstacle(place, size, float(rng.uniform(0.0, np.pi)), False)
    if kind == 2:
        radius = rng.uniform(0.06, 0.2)
        return CourseObstacle(place, np.array([radius, radius, rng.uniform(0.4, 1.2)]), 0.0, True)
    # A workbench.
    size = np.array([rng.uniform(0.3, 0.6), rng.uniform(0.25, 0.4), 0.45])
    return CourseObstacle(place, size, float(rng.uniform(0.0, np.pi)), False)
