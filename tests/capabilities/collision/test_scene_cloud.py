"""A camera's cloud becomes a world without the robot, stray points, and what is spared."""

from __future__ import annotations

import numpy as np

from golem.capabilities.collision.obstacles import ROBOT_MARGIN, World, cleared, cloud_grid, displaced, scene_world
from golem.types import Array

NONE = np.zeros((0, 4))


def patch(x: float, y: float, z: float, n: int = 200) -> Array:
    return np.array([x, y, z]) + np.random.default_rng(0).uniform(-0.03, 0.03, (n, 3))


def near(points: Array, at: Array, spheres: Array = NONE, spared: list[tuple[Array, float]] | None = None) -> float:
    return float(scene_world(points, spheres, spared or []).distance(np.append(at, 0.0)[None])[0][0])


def test_what_is_seen_is_in_the_way() -> None:
    assert near(patch(0.5, 0.0, 0.0), np.array([0.5, 0.0, 0.0])) < 0.01
    assert near(np.full((5, 3), np.nan), np.zeros(3)) == near(np.zeros((0, 3)), np.zeros(3)) == 0.2


def test_a_stray_point_is_not() -> None:
    assert near(np.array([[0.5, 0.0, 0.0]]), np.array([0.5, 0.0, 0.0])) == 0.2


def test_neither_is_the_robot_nor_what_is_spared() -> None:
    points, middle = patch(0.5, 0.0, 0.0), np.array([0.5, 0.0, 0.0])
    robot = np.array([[0.5, 0.0, 0.10, 0.05]])
    assert near(points, middle, robot) == 0.2
    assert near(points, middle, robot + (0.0, 0.0, ROBOT_MARGIN, 0.0)) < 0.1
    assert near(points, middle, spared=[(middle, 0.06)]) == 0.2


def test_cells_that_are_cleared_leave_the_others_as_they_were() -> None:
    points = np.concatenate([patch(0.5, 0.0, 0.0), patch(0.5, 0.3, 0.0)])
    grid = cleared(cloud_grid(points), np.array([[0.5, 0.0, 0.0, 0.1]]), 0.0)
    only = cloud_grid(patch(0.5, 0.3, 0.0))
    np.testing.assert_array_equal(grid.cells >= 0, only.cells >= 0)
    np.testing.assert_array_equal(grid.steps, only.steps)
    assert cleared(only, np.array([[0.5, 0.0, 0.0, 0.1]]), 0.0) is only


def test_a_displaced_world_is_elsewhere_by_that_much() -> None:
    points = np.random.default_rng(0).uniform(-0.01, 0.01, (200, 3)) + (0.5, 0.0, 0.0)
    world = scene_world(points, np.zeros((0, 4)))
    by = np.array([0.05, -0.02, 0.03])
    ball = np.array([[0.55, 0.0, 0.0, 0.01]])
    moved = displaced(world, by)
    before, after = world.distance(ball)[0], moved.distance(ball + np.append(by, 0.0))[0]
    np.testing.assert_allclose(before, after, atol=1e-9)
    assert displaced(World(), by).cloud is None
