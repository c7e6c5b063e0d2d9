"""Courses drawn from a seed: always the same, never without a way, and never with a straight one."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from golem.robots.worlds.furnished import GOAL, START, CourseObstacle, draw_course, outline, passable


@pytest.mark.parametrize("seed", range(12))
def test_a_way_is_left_and_it_is_not_the_straight_one(seed: int) -> None:
    course = draw_course(np.random.default_rng(seed), 4)
    assert len(course) == 4 and passable(course)
    line = np.linspace(START, GOAL, 200)
    assert min(_distance(line, outline(one)) for one in course) < 0.5


def test_the_same_seed_draws_the_same_course() -> None:
    one, other = (draw_course(np.random.default_rng(5), 4) for _ in range(2))
    for a, b in zip(one, other, strict=True):
        assert (a.place == b.place).all() and (a.size == b.size).all() and (a.yaw, a.round) == (b.yaw, b.round)


def test_a_wall_across_the_hall_is_no_course() -> None:
    wall = CourseObstacle(np.array([3.0, 0.1]), np.array([3.6, 0.05, 1.0]), np.pi / 2, False)
    assert not passable([wall])


def test_none_asked_for_is_none() -> None:
    assert draw_course(np.random.default_rng(0), 0) == ()


def _distance(points: np.ndarray, corners: np.ndarray) -> float:
    polygon = corners.astype(np.float32)
    return min(-cv2.pointPolygonTest(polygon, (float(x), float(y)), True) for x, y in points)
