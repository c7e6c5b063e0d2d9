"""Small maps and a robot that follows its twists exactly, for tests of navigators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from golem.capabilities.navigation.base import Navigator, NavInputs
from golem.capabilities.navigation.footprint import HOME
from golem.interfaces.nav_payloads import NavStep, OccupancyGrid, Scan
from golem.types import Array, PlanarPose, Twist

RESOLUTION = 0.05
FLOOR = np.array([0.0, 0.0, -1.0])
Box = tuple[float, float, float, float]
"""x from, x to, y from, y to [m]."""


def room(*boxes: Box, size: Box = (-2.0, 8.0, -3.0, 3.0)) -> OccupancyGrid:
    """Return a walled room with boxes in it, all of it known."""
    x0, x1, y0, y1 = size
    cells = np.zeros((round((y1 - y0) / RESOLUTION), round((x1 - x0) / RESOLUTION)), np.int8)
    cells[0], cells[-1], cells[:, 0], cells[:, -1] = 100, 100, 100, 100
    for a, b, c, d in boxes:
        rows = slice(round((c - y0) / RESOLUTION), round((d - y0) / RESOLUTION))
        cells[rows, round((a - x0) / RESOLUTION) : round((b - x0) / RESOLUTION)] = 100
    return OccupancyGrid(0.0, PlanarPose(x0, y0, 0.0), RESOLUTION, cells)


def seen(t: float, *boxes: Box) -> Scan:
    """Return a scan of the outlines of boxes, half a metre above the floor."""
    points = [np.zeros((0, 3))]
    for a, b, c, d in boxes:
        x, y = np.meshgrid(np.arange(a, b + 1e-9, 0.04), np.arange(c, d + 1e-9, 0.04))
        points.append(np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -0.5)]))
    return Scan(t, np.concatenate(points), np.array([0.0, 0.0, 0.7]), FLOOR)


class ExactRobot:
    """Follows every twist exactly, and remembers how near its footprint came to what is full."""

    def __init__(self, navigator: Navigator, grid: OccupancyGrid, start: PlanarPose | None = None) -> None:
        """Stand at `start`, by default at the origin."""
        self.navigator, self.grid = navigator, grid
        self.pose = start or PlanarPose(0.0, 0.0, 0.0)
        self.t, self.hits = 0.0, 0
        self.steps: list[NavStep] = []
        self.moving = False

    def walk(
        self,
        goal: PlanarPose,
        seconds: float,
        scan: Callable[[float], Scan | None] = seen,
        grid: Callable[[float], OccupancyGrid | None] | None = None,
    ) -> NavStep:
        """Pursue a goal until it has ended or `seconds` have passed; return the last step."""
        dt = 1.0 / self.navigator.rate
        self.navigator.start(goal)
        end = self.t + seconds
        while self.t < end:
            tenth = round(np.floor(10.0 * self.t + 1e-6) / 10.0, 1)
            known = self.grid if grid is None else grid(self.t)
            inputs = NavInputs(self.pose, self.moving, known, scan(tenth), HOME)
            step = self.navigator.step(inputs, dt)
            self.steps.append(step)
            self.t += dt
            if step.ended:
                break
            v = step.twist
            self.moving = v != Twist()
            self.pose = self.pose @ PlanarPose(v.vx * dt, v.vy * dt, v.wz * dt)
            self.hits += self.touches()
        return self.steps[-1]

    def touches(self) -> bool:
        """Return whether the footprint is on a full cell now."""
        o = self.grid.origin
        index = np.floor((HOME.at(self.pose) - (o.x, o.y)) / self.grid.resolution).astype(int)
        return bool((self.grid.cells[index[:, 1], index[:, 0]] > 50).any())


def aged(grid: OccupancyGrid, t: float) -> OccupancyGrid:
    """Return the same map, newer."""
    return replace(grid, t=t)


def wall_with_gap(gap: tuple[float, float]) -> tuple[Box, Box]:
    """Return a wall across the room at x = 3 m with a gap in it [m]."""
    return (2.9, 3.1, -3.0, gap[0]), (2.9, 3.1, gap[1], 3.0)


def corners(points: Array) -> Array:
    """Return lowest and highest x and y of places (n, 2)."""
    return np.concatenate([points.min(axis=0), points.max(axis=0)])
