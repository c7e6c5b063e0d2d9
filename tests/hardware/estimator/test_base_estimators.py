"""Both estimators of a robot on its feet, against the truth: same contract, same tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem import registry
from golem.hardware.estimator.base import BaseEstimator
from golem.robots.model.spatial import rotation_rpy
from golem.robots.sensors.imu import ImuBias, ImuErrors, ImuModel
from golem.types import Array, BaseEstimate, LowState

DT = 0.002
YAW = 2.0


@pytest.fixture(params=["random_walk_kf", "invariant_ekf"])
def estimator(request: pytest.FixtureRequest) -> BaseEstimator:
    return registry.create("estimator", request.param, {})


def follow(
    world: Any,
    estimator: BaseEstimator,
    seconds: float,
    sensors: Callable[[LowState], LowState] = lambda state: state,
    push: Callable[[float], Array | None] = lambda t: None,
) -> tuple[list[BaseEstimate], Array, Array]:
    """Exercise; return estimates, and true velocity (n, 3) and position (n, 3) in odom."""
    start = world.T
    R = rotation_rpy(0.0, 0.0, float(np.arctan2(start[1, 0], start[0, 0]))).T
    estimator.reset(sensors(world.state()))
    estimates, velocity, position = [], [], []
    for i in range(round(seconds / DT)):
        world.exercise(i * DT)
        estimates.append(estimator.step(sensors(world.advance(push(i * DT))), DT))
        velocity.append(R @ world.velocity)
        position.append(R @ (world.T[:3, 3] - start[:3, 3]))
    return estimates, np.array(velocity), np.array(position)


def test_it_satisfies_the_contract(estimator: BaseEstimator) -> None:
    assert isinstance(estimator, BaseEstimator)


def test_it_follows_squats_weight_shifts_and_a_turning_waist(
    world: Callable[..., Any], estimator: BaseEstimator
) -> None:
    robot = world(yaw=YAW)
    estimates, velocity, position = follow(robot, estimator, 1.5)
    error = np.array([e.velocity for e in estimates]) - velocity
    assert np.sqrt((velocity[150:] ** 2).sum(axis=1).mean()) > 0.1
    assert np.sqrt((error[150:] ** 2).sum(axis=1).mean()) < 0.012
    drift = np.array([e.T_odom_base[:3, 3] for e in estimates]) - position
    assert np.abs(drift).max() < 0.008
    last = estimates[-1]
    R_true = rotation_rpy(0.0, 0.0, -YAW) @ robot.T[:3, :3]
    np.testing.assert_allclose(last.T_odom_base[:3, :3], R_true, atol=0.01)
    # The soles are on the floor, so the height of base_link above them is its height in the world.
    assert last.height == pytest.approx(robot.T[2, 3], abs=0.003)
    assert np.all(last.contact > 0.5) and not last.stale


def test_it_follows_a_push(world: Callable[..., Any], estimator: BaseEstimator) -> None:
    robot = world(yaw=-1.0)
    force = np.array([60.0, 40.0, 0.0])
    estimates, velocity, _ = follow(robot, estimator, 1.0, push=lambda t: force if 0.4 < t < 0.6 else None)
    error = np.array([e.velocity for e in estimates]) - velocity
    assert np.abs(error[150:]).max() < 0.03


def test_imu_errors_of_the_field_profile_do_not_move_it(world: Callable[..., Any], estimator: BaseEstimator) -> None:
    errors = ImuErrors(gyro_noise=0.0039, acc_noise=0.028)
    tilt = np.array([1.0, 0.0026, -0.0026, 0.0])
    bias = ImuBias(tilt / np.linalg.norm(tilt), np.array([0.002, -0.002, 0.002]), np.array([0.05, 0.05, -0.05]))
    imu = ImuModel(errors, bias, np.random.default_rng(0))

    def sensors(state: LowState) -> LowState:
        return replace(state, imu=imu.measure(state.imu.quat, state.imu.gyro, state.imu.acc))

    estimates, velocity, _ = follow(world(yaw=YAW), estimator, 1.5, sensors)
    error = (np.array([e.velocity for e in estimates]) - velocity)[250:]
    assert np.sqrt((error**2).sum(axis=1).mean()) < 0.02


def test_in_the_air_it_predicts_and_says_that_it_is_stale(world: Callable[..., Any], estimator: BaseEstimator) -> None:
    robot = world()
    estimates, *_ = follow(robot, estimator, 0.3)
    assert not any(e.stale for e in estimates[100:])
    stale = [estimator.step(robot.advance(robot.hoist(1.1)), DT).stale for _ in range(250)]
    first = stale.index(True)
    assert 0.2 <= first * DT < 0.35 and all(stale[first:])


def test_hanging_feet_are_stale_and_the_base_stays(world: Callable[..., Any], estimator: BaseEstimator) -> None:
    state = world(floor=False).state()
    # At rest in a band: a specific force of one g with a bias, legs that carry only themselves.
    acc = np.array([0.05, 0.05, 9.86])
    still = replace(state, dq=0.0 * state.dq, imu=replace(state.imu, gyro=np.zeros(3), acc=acc))
    estimator.reset(still)
    for _ in range(1000):
        estimate = estimator.step(still, DT)
    assert estimate.stale and estimate.height == 0.0
    np.testing.assert_allclose(estimate.velocity, 0.0, atol=0.03)
    np.testing.assert_allclose(estimate.T_odom_base, np.eye(4), atol=0.05)


def test_a_reset_starts_over(world: Callable[..., Any], estimator: BaseEstimator) -> None:
    def run() -> list[BaseEstimate]:
        return follow(world(yaw=1.0), estimator, 0.2)[0]

    for one, other in zip(run(), run(), strict=True):
        np.testing.assert_array_equal(one.T_odom_base, other.T_odom_base)
        np.testing.assert_array_equal(one.velocity, other.velocity)


def test_what_it_returns_is_the_callers(world: Callable[..., Any], estimator: BaseEstimator) -> None:
    robot = world()
    follow(robot, estimator, 0.1)
    state = robot.advance()
    estimate = estimator.step(state, DT)
    expected = [array.copy() for array in (estimate.T_odom_base, estimate.velocity, estimate.contact)]
    estimator.step(robot.advance(), DT)
    for array, was in zip((estimate.T_odom_base, estimate.velocity, estimate.contact), expected, strict=True):
        np.testing.assert_array_equal(array, was)
