"""The last look before a grasp: what is narrow comes between the pads."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.grasping.base import Grasp
from golem.capabilities.grasping.centroid import grasp_pose
from golem.skills.palm_look import centred
from golem.types import Array

UP = np.array([0.0, 0.0, 1.0])


def ring(radius: float, middle: Array, low: float, high: float) -> Array:
    """Return points (n, 3) of an upright round wall around `middle` (2,) [m]."""
    turn, z = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 2 * np.pi, 90), np.linspace(low, high, 30)))
    return np.column_stack([middle[0] + radius * np.cos(turn), middle[1] + radius * np.sin(turn), z])


@pytest.mark.parametrize("yaw", [0.0, 1.2])
def test_a_neck_beside_the_pads_comes_between_them(yaw: float) -> None:
    T = grasp_pose(np.array([0.5, 0.2, 1.0]), yaw, UP)
    neck = ring(0.015, T[:2, 3] + 0.012 * T[:2, 0] + 0.005 * T[:2, 1], 0.99, 1.04)
    got = centred(Grasp(T, 0.055, 1.0), neck).T_odom_gripper
    np.testing.assert_allclose(got[:3, 3], T[:3, 3] + 0.012 * T[:3, 0], atol=0.001)
    np.testing.assert_array_equal(got[:3, :3], T[:3, :3])


def test_what_is_wide_or_not_there_leaves_the_grasp_where_it_is() -> None:
    T = grasp_pose(np.array([0.5, 0.2, 1.0]), 0.0, UP)
    grasp = Grasp(T, 0.075, 1.0)
    can = ring(0.033, T[:2, 3] + 0.012 * T[:2, 0], 0.95, 1.04)
    below = ring(0.015, T[:2, 3], 0.90, 0.99)
    assert centred(grasp, can) is grasp and centred(grasp, below) is grasp
