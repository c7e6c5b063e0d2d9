"""The invariant filter by itself: its algebra, biases found, slipping feet put anew, a covariance that stays one."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from golem.hardware.estimator.invariant_ekf import InvariantConfig, InvariantFilter
from golem.hardware.estimator.invariant_kernel import correct, exp_and_jacobian
from golem.robots.model.spatial import skew
from golem.types import Array

DT = 0.002
UP = np.array([0.0, 0.0, 9.81])
BOTH, NEITHER = np.ones(2), np.zeros(2)
POINTS = np.array([[0.0, 0.15, -1.2], [0.0, -0.15, -1.2]])
STILL = np.zeros((2, 3))


def stand(filter: InvariantFilter, steps: int, gyro: Array, acc: Array, points: Array = POINTS) -> None:
    for _ in range(steps):
        filter.predict(gyro, acc, BOTH, DT)
        heading = float(np.arctan2(filter.R[1, 0], filter.R[0, 0]))
        filter.update(points, BOTH, STILL, heading, hanging=False)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 1e-3, 1.0, 3.0])
def test_exponential_and_jacobian_are_those_of_the_matrix_exponential(angle: float) -> None:
    phi = angle * np.array([0.6, -0.48, 0.64])
    R, J = exp_and_jacobian(phi)
    np.testing.assert_allclose(R, expm(skew(phi)), atol=1e-12)
    # The left Jacobian is the translation part of the exponential of SE(3).
    x = np.array([0.3, -0.2, 0.5])
    tangent = np.zeros((4, 4))
    tangent[:3, :3], tangent[:3, 3] = skew(phi), x
    np.testing.assert_allclose(J @ x, expm(tangent)[:3, 3], atol=1e-12)


def test_prediction_integrates_a_turn_on_a_circle() -> None:
    filter = InvariantFilter(InvariantConfig())
    rate, speed = 1.0, 0.5
    filter.x[0] = (speed, 0.0, 0.0)
    n = 1000
    for _ in range(n):
        # Turning left at constant speed: centripetal acceleration in the body's y.
        filter.predict(np.array([0.0, 0.0, rate]), UP + [0.0, rate * speed, 0.0], NEITHER, DT)
    angle, radius = rate * n * DT, speed / rate
    np.testing.assert_allclose(filter.R, Rotation.from_rotvec([0, 0, angle]).as_matrix(), atol=1e-9)
    expected = radius * np.array([np.sin(angle), 1.0 - np.cos(angle), 0.0])
    np.testing.assert_allclose(filter.x[1], expected, atol=2e-3)


def test_the_covariance_predicts_how_an_error_grows() -> None:
    """The linear model of the error against two filters that differ by it, far from the origin."""
    config = InvariantConfig()
    one, other = InvariantFilter(config), InvariantFilter(config)
    xi = 1e-4 * np.random.default_rng(0).standard_normal(21)
    start = np.array([3.0, -2.0, 1.0])
    for filter in (one, other):
        filter.reset(Rotation.from_rotvec([0.1, -0.2, 0.5]).as_matrix(), start)
        filter.x[0] = (0.4, 0.1, 0.0)
        filter.x[2:] = start + POINTS
    correct(other.R, other.x, other.bias, xi)
    # The covariance of a single error is its outer square: noise apart, it must stay that.
    one.P[:] = np.outer(xi, xi)
    for name in ("noise", "wander", "contact_noise"):
        one.memory[name] = 0.0
    gyro, acc = np.array([0.3, -0.2, 0.4]), UP + [0.5, 0.2, -0.3]
    for _ in range(100):
        one.predict(gyro, acc, BOTH, DT)
        other.predict(gyro, acc, BOTH, DT)
    turn = Rotation.from_matrix(other.R @ one.R.T).as_rotvec()
    moved = other.x - one.x @ exp_and_jacobian(turn)[0].T
    grown = np.concatenate([turn, moved.ravel(), (other.bias - one.bias).ravel()])
    np.testing.assert_allclose(one.P, np.outer(grown, grown), atol=0.03 * np.abs(one.P).max())


def test_it_finds_the_biases_of_a_tilted_standing_robot() -> None:
    filter = InvariantFilter(InvariantConfig(tilt=1e-3))
    gyro = np.array([0.004, -0.003, 0.002])
    stand(filter, 5000, gyro, UP + [0.0, 0.0, 0.05])
    np.testing.assert_allclose(filter.bias[0], gyro, atol=1e-3)
    assert filter.bias[1, 2] == pytest.approx(0.05, abs=0.02)
    np.testing.assert_allclose(filter.x[0], 0.0, atol=5e-3)


def test_a_wrong_tilt_is_levelled_by_gravity() -> None:
    filter = InvariantFilter(InvariantConfig(tilt=0.05, acc_bias=1e-3, acc_walk=0.0))
    filter.reset(Rotation.from_rotvec([0.03, -0.02, 0.0]).as_matrix(), np.zeros(3))
    stand(filter, 3000, np.zeros(3), UP)
    np.testing.assert_allclose(filter.R[2], [0.0, 0.0, 1.0], atol=3e-3)


def test_a_foot_that_jumps_is_put_where_it_is_and_moves_nothing() -> None:
    filter = InvariantFilter(InvariantConfig())
    stand(filter, 500, np.zeros(3), UP)
    before = filter.x.copy()
    jumped = POINTS + [[0.0, 0.0, 0.0], [0.1, 0.05, 0.0]]
    filter.predict(np.zeros(3), UP, BOTH, DT)
    believed = filter.update(jumped, BOTH, STILL, 0.0, hanging=False)
    assert believed.tolist() == [True, False]
    stand(filter, 100, np.zeros(3), UP, jumped)
    np.testing.assert_allclose(filter.x[:2], before[:2], atol=2e-3)
    np.testing.assert_allclose(filter.x[3] - before[3], [0.1, 0.05, 0.0], atol=5e-3)


def test_a_contact_point_that_moves_within_the_sole_moves_nothing() -> None:
    filter = InvariantFilter(InvariantConfig())
    stand(filter, 500, np.zeros(3), UP)
    before = filter.x[:2].copy()
    for i in range(50):
        filter.predict(np.zeros(3), UP, BOTH, DT)
        shift = np.array([[0.002, 0.0, 0.0], [0.0, 0.0, 0.0]])
        moved = POINTS + (i + 1) * shift
        assert filter.update(moved, BOTH, shift, 0.0, hanging=False).all()
    np.testing.assert_allclose(filter.x[:2], before, atol=2e-3)


def test_the_covariance_stays_symmetric_and_positive() -> None:
    filter, rng = InvariantFilter(InvariantConfig()), np.random.default_rng(0)
    for i in range(2000):
        weight = np.array([float(i % 400 < 250), float((i + 200) % 400 < 250)])
        filter.predict(0.3 * rng.standard_normal(3), UP + rng.standard_normal(3), weight, DT)
        filter.update(POINTS + 0.003 * rng.standard_normal((2, 3)), weight, STILL, 0.0, hanging=False)
    np.testing.assert_array_equal(filter.P, filter.P.T)
    assert np.linalg.eigvalsh(filter.P).min() > -1e-12
