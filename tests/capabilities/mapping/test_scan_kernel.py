"""Points of a scan: what is none is left out, and each is put where the sensor was at its own time."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from golem.capabilities.mapping.robot_filter import ASTRAY, MARGIN, RobotFilter, posed, sound
from golem.capabilities.mapping.voxel_kernel import span, within

ARM = ("shoulder", "elbow", "wrist", "hand", "crank", "finger")


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
    links = filter.model.robot.links
    body = np.array([not any(k in links[i].name for k in ARM) for i in filter.model.sphere_link])
    own = filter.own(points, q)
    assert own[(apart < MARGIN).any(axis=1)].all()
    # An arm of one metre may be 0.12 m beside where its joints say, torso and legs may not.
    assert not own[(apart > MARGIN + ASTRAY).all(axis=1)].any()
    nearest = body[apart.argmin(axis=1)] & (apart[:, ~body].min(axis=1) > MARGIN + ASTRAY)
    np.testing.assert_array_equal(own[nearest], (apart < MARGIN).any(axis=1)[nearest])
    assert 50 < own.sum() < 1500


def test_a_hand_whose_encoders_count_from_wrong_zeros_is_the_robots_own() -> None:
    filter, q = RobotFilter(), np.zeros(27)
    hand = filter.model.sphere_link == [link.name for link in filter.model.robot.links].index("left_hand")
    wrong = np.zeros(27)
    wrong[13:20] = np.array([-0.07, 0.046, -0.018, -0.056, -0.029, 0.037, 0.015])
    there = filter.balls(q - wrong)[hand]
    beside = there[:, :3] + np.array([0.0, 0.09, 0.0])
    assert np.linalg.norm(there[:, :3] - filter.balls(q)[hand][:, :3], axis=1).min() > 0.03
    assert filter.own(np.ascontiguousarray(beside), q).all()
    assert not filter.own(np.ascontiguousarray(beside + np.array([0.0, 0.3, 0.0])), q).any()


def test_points_within_reach_and_what_they_span() -> None:
    origin = np.array([1.0, 0.0, 0.0])
    points = np.array([[1.5, 0, 0], [9.0, 0, 0], [np.nan, 0, 0], [0.0, -1.0, 3.0]])
    near = within(points, origin, 4.0)
    np.testing.assert_array_equal(near, points[[0, 3]])
    low, high = span(near, origin)
    assert low.tolist() == [0.0, -1.0] and high.tolist() == [1.5, 0.0]
