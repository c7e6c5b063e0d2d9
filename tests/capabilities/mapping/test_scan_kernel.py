"""Points of a scan: what is none is left out, and each is put where the sensor was at its own time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.mapping.robot_filter import MARGIN, RobotFilter
from golem.capabilities.mapping.scan_kernel import posed, sound
from golem.capabilities.mapping.voxel_kernel import span, within


def test_what_is_not_finite_or_too_near_is_no_point() -> None:
    points = np.array([[1.0, 0, 0], [0.1, 0, 0], [np.nan, 1, 1], [np.inf, 0, 0], [0, 2.0, 0]])
    offsets = np.array([0.0, 0.0, 0.0, 0.0, np.nan])
    assert sound(points, offsets, 0.35).tolist() == [True, False, False, False, False]


def test_each_point_is_posed_at_its_own_time() -> None:
    rng, duration = np.random.default_rng(0), 0.1
    points, offsets = rng.uniform(-5.0, 5.0, (200, 3)), rng.uniform(0.0, duration, 200)
    speed, turn = np.array([0.6, -0.1, 0.05]), np.array([0.0, 0.1, 0.5])
    moments = np.linspace(0.0, duration, 11)
    R = Rotation.from_rotvec(np.outer(moments, turn)).as_matrix()
    world = posed(points, offsets, duration, R, np.outer(moments, speed))
    exact = Rotation.from_rotvec(np.outer(offsets, turn)).apply(points) + np.outer(offsets, speed)
    np.testing.assert_allclose(world, exact, atol=1e-4)
    late = posed(points, np.full(200, duration), duration, R, np.outer(moments, speed))
    np.testing.assert_allclose(late, points @ R[-1].T + moments[-1] * speed, atol=1e-12)


def test_the_robots_own_points_are_those_within_its_spheres() -> None:
    rng, filter, q = np.random.default_rng(1), RobotFilter(), np.zeros(27)
    points, balls = rng.uniform(-1.2, 1.2, (3000, 3)), filter.balls(q)
    apart = np.linalg.norm(points[:, None] - balls[:, :3], axis=2) - balls[:, 3]
    own = filter.own(points, q)
    np.testing.assert_array_equal(own, (apart < MARGIN).any(axis=1))
    assert 50 < own.sum() < 1500


def test_points_within_reach_and_what_they_span() -> None:
    origin = np.array([1.0, 0.0, 0.0])
    points = np.array([[1.5, 0, 0], [9.0, 0, 0], [np.nan, 0, 0], [0.0, -1.0, 3.0]])
    near = within(points, origin, 4.0)
    np.testing.assert_array_equal(near, points[[0, 3]])
    low, high = span(near, origin)
    assert low.tolist() == [0.0, -1.0] and high.tolist() == [1.5, 0.0]
