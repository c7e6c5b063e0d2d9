"""The tethered base: its orientation is the IMU's, less the torso joint; its place is where it hangs."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from golem.hardware.estimator.base import BaseEstimator
from golem.hardware.estimator.tether import TetherEstimator
from golem.robots.model.table import JOINT_NAMES
from golem.types import NUM_JOINTS, Array, Imu, LowState

TORSO = JOINT_NAMES.index("torso_joint")
angle = st.floats(-2.0, 2.0)
tilt = st.floats(-0.5, 0.5)


def state(R_world_torso: Array, torso: float, t: float = 0.0) -> LowState:
    """Return what a robot at rest reports whose IMU has that orientation and whose waist is turned by `torso`."""
    x, y, z, w = Rotation.from_matrix(R_world_torso).as_quat()
    q = np.zeros(NUM_JOINTS)
    q[TORSO] = torso
    zero = np.zeros(NUM_JOINTS)
    return LowState(t, q, zero, zero, Imu(np.array([w, x, y, z]), np.zeros(3), np.zeros(3)))


def rpy(roll: float, pitch: float, yaw: float) -> Array:
    return Rotation.from_euler("ZYX", [yaw, pitch, roll]).as_matrix()


def about_z(yaw: float) -> Array:
    return rpy(0.0, 0.0, yaw)


def started(first: LowState) -> TetherEstimator:
    estimator = TetherEstimator()
    estimator.reset(first)
    return estimator


def test_it_is_a_base_estimator() -> None:
    assert isinstance(TetherEstimator(), BaseEstimator)


@given(angle, angle)
def test_turning_the_waist_does_not_turn_the_base(heading: float, torso: float) -> None:
    R_base = about_z(heading)
    estimator = started(state(R_base, 0.0))
    estimate = estimator.step(state(R_base @ about_z(torso), torso), 0.002)
    np.testing.assert_allclose(estimate.T_odom_base, np.eye(4), atol=1e-12)


@given(tilt, tilt, angle, angle)
def test_the_tilt_of_the_base_is_found_whatever_the_waist_does(
    roll: float, pitch: float, heading: float, torso: float
) -> None:
    R_base = rpy(roll, pitch, heading)
    estimator = started(state(R_base @ about_z(torso), torso))
    T = estimator.step(state(R_base @ about_z(torso), torso), 0.002).T_odom_base
    np.testing.assert_allclose(T[:3, :3], rpy(roll, pitch, 0.0), atol=1e-9)


@given(angle, angle)
def test_the_heading_counts_from_the_reset(first: float, later: float) -> None:
    estimator = started(state(about_z(first), 0.0))
    T = estimator.step(state(about_z(first + later), 0.0), 0.002).T_odom_base
    np.testing.assert_allclose(T[:3, :3], about_z(later), atol=1e-9)


def test_a_second_reset_starts_over() -> None:
    estimator = started(state(about_z(1.0), 0.0))
    estimator.reset(state(about_z(-0.5), 0.0))
    T = estimator.step(state(about_z(-0.5), 0.0), 0.002).T_odom_base
    np.testing.assert_allclose(T, np.eye(4), atol=1e-12)


@given(tilt, tilt, angle, st.floats(0.9, 1.1))
def test_the_pose_is_rigid_even_if_the_quaternion_is_not_quite_of_unit_length(
    roll: float, pitch: float, torso: float, length: float
) -> None:
    sample = state(rpy(roll, pitch, 0.3) @ about_z(torso), torso)
    sample.imu.quat[:] *= length
    R = started(sample).step(sample, 0.002).T_odom_base[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)


def test_it_stamps_the_time_of_the_measurement_and_says_it_stands_still() -> None:
    sample = state(np.eye(3), 0.0, t=3.25)
    estimate = started(sample).step(sample, 0.002)
    assert estimate.t == 3.25
    np.testing.assert_array_equal(estimate.velocity, np.zeros(3))
    np.testing.assert_array_equal(estimate.T_odom_base[:3, 3], np.zeros(3))


def test_a_returned_pose_is_the_callers() -> None:
    sample = state(rpy(0.1, 0.0, 0.0), 0.0)
    estimator = started(sample)
    first = estimator.step(sample, 0.002).T_odom_base.copy()
    estimator.step(sample, 0.002).T_odom_base[:] = 7.0
    np.testing.assert_array_equal(estimator.step(sample, 0.002).T_odom_base, first)
