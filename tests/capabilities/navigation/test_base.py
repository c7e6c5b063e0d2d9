"""Poses on the floor."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.types import PlanarPose, wrap

poses = st.builds(PlanarPose, *(st.floats(-5.0, 5.0) for _ in range(3)))


def matrix(pose: PlanarPose) -> np.ndarray:
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    return np.array([[c, -s, pose.x], [s, c, pose.y], [0.0, 0.0, 1.0]])


@given(poses, poses)
def test_poses_compose_as_their_matrices_do(a: PlanarPose, b: PlanarPose) -> None:
    np.testing.assert_allclose(matrix(a @ b), matrix(a) @ matrix(b), atol=1e-9)
    np.testing.assert_allclose(matrix(a.to(b)), np.linalg.inv(matrix(a)) @ matrix(b), atol=1e-9)


@given(st.floats(-100.0, 100.0))
def test_wrapped_angles_lie_within_half_a_turn(angle: float) -> None:
    assert abs(wrap(angle)) <= math.pi
    assert math.cos(wrap(angle) - angle) == pytest.approx(1.0)


def test_a_pose_in_space_is_seen_from_above() -> None:
    T = np.eye(4)
    T[:3, :3] = [[0.0, -1.0, 0.0], [0.8, 0.0, 0.6], [-0.6, 0.0, 0.8]]
    T[:3, 3] = (1.0, 2.0, 3.0)
    pose = PlanarPose.of(T)
    assert (pose.x, pose.y) == (1.0, 2.0)
    assert pose.yaw == pytest.approx(math.pi / 2)
