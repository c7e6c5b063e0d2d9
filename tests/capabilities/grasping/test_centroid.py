"""The centroid grasp: straight down, on the centre, no deeper than the ground allows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.capabilities.grasping.base import Gripper
from golem.capabilities.grasping.centroid import Centroid, CentroidConfig, grasp_depth, grasp_pose
from golem.types import Array, Detection, LocalizedObject

TOP = np.array([0.43, -0.14, -0.03])

NO_SCENE = np.zeros((0, 3))


def gripper(yaw: float) -> Gripper:
    return Gripper("right", np.eye(4), yaw)


def thing(points: Array) -> LocalizedObject:
    box = np.array([0.0, 0.0, 10.0, 10.0])
    return LocalizedObject(Detection("screw", 0.7, box, box[:2] + 5), 0.0, TOP.copy(), points)


def head_on_ground(height: float) -> Array:
    """Return a cloud of a head whose top is `height` above the ground around it."""
    return np.array([TOP] * 20 + [TOP - (0.0, 0.0, height)] * 60)


@given(st.floats(-np.pi, np.pi))
def test_grasp_pose_points_down_and_turns_about_the_vertical(yaw: float) -> None:
    T = grasp_pose(TOP, yaw)
    R = T[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) == pytest.approx(1.0)
    np.testing.assert_array_equal(R[:, 2], [0.0, 0.0, -1.0])
    np.testing.assert_allclose(R[:, 0], [np.cos(yaw), np.sin(yaw), 0.0], atol=1e-12)
    np.testing.assert_array_equal(T[:3, 3], TOP)


def test_without_a_cloud_the_depth_is_the_usual_one() -> None:
    assert grasp_depth(thing(np.zeros((0, 3))), 0.0115, 0.003) == 0.0115


@pytest.mark.parametrize(
    ("height", "depth"), [(0.030, 0.0115), (0.0145, 0.0115), (0.010, 0.007), (0.005, 0.0115 / 3.0), (0.0, 0.0115 / 3.0)]
)
def test_the_tips_stay_clear_of_the_ground_but_grip_a_third(height: float, depth: float) -> None:
    assert grasp_depth(thing(head_on_ground(height)), 0.0115, 0.003) == pytest.approx(depth)


def test_a_few_points_below_the_ground_are_not_the_ground() -> None:
    cloud = np.vstack([head_on_ground(0.010), np.tile(TOP - (0.0, 0.0, 0.08), (5, 1))])
    assert grasp_depth(thing(cloud), 0.0115, 0.003) == pytest.approx(0.007)


@given(st.floats(-0.05, 0.2), st.floats(0.001, 0.03), st.floats(0.0, 0.01))
def test_the_depth_is_always_between_a_third_and_all_of_it(height: float, depth: float, clearance: float) -> None:
    got = grasp_depth(thing(head_on_ground(height)), depth, clearance)
    assert depth / 3.0 - 1e-12 <= got <= depth + 1e-12


def test_one_grasp_below_the_top_with_the_score_of_the_detection() -> None:
    config = CentroidConfig(depth=0.01, gap=0.04)
    (grasp,) = Centroid(config).propose(thing(np.zeros((0, 3))), NO_SCENE, gripper(0.3))
    np.testing.assert_allclose(grasp.T_odom_gripper, grasp_pose(TOP - (0.0, 0.0, 0.01), 0.3))
    assert (grasp.gap, grasp.score) == (0.04, 0.7)


def test_it_is_executed_open_loop() -> None:
    method = Centroid()
    target = thing(np.zeros((0, 3)))
    assert method.servo(target, method.propose(target, NO_SCENE, gripper(0.0))[0], 0.0) is None
