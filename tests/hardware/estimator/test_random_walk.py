"""The random-walk filter: what planted feet say, whom it believes, and that many robots are one robot many times."""

from __future__ import annotations

import numpy as np
import pytest
from tests.hardware.estimator.sensed_feet import base_velocity

from golem.hardware.estimator.feet import Contact, ContactConfig
from golem.hardware.estimator.random_walk_kf import FILTER, RandomWalk, RandomWalkConfig, filter_options, fuse
from golem.native import new_record

DT = 0.002
BOTH = np.ones(2)


def run(filter: RandomWalk, measured: np.ndarray, weight: np.ndarray, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        filter.step(measured, weight, DT)


def test_it_converges_to_what_both_feet_say() -> None:
    filter = RandomWalk(RandomWalkConfig())
    run(filter, np.tile([0.5, -0.2, 0.1], (2, 1)), BOTH, 0.1)
    np.testing.assert_allclose(filter.velocity, [0.5, -0.2, 0.1], atol=1e-3)
    assert filter.unmeasured == 0.0


def test_the_noise_of_the_feet_is_averaged_and_the_variance_says_by_how_much() -> None:
    config = RandomWalkConfig(walk=0.1)
    filter, rng = RandomWalk(config), np.random.default_rng(1)
    errors = []
    for _ in range(4000):
        errors.append(filter.step(config.foot_noise * rng.standard_normal((2, 3)), BOTH, DT))
    spread = np.std(errors[500:])
    assert spread < 0.5 * config.foot_noise
    # The true velocity does not wander here, so the filter is on the safe side of what it achieves.
    assert 0.5 * np.sqrt(filter.variance) < spread < np.sqrt(filter.variance)


def test_a_foot_without_weight_says_nothing() -> None:
    filter = RandomWalk(RandomWalkConfig())
    run(filter, np.array([[0.3, 0.0, 0.0], [-9.0, 0.0, 0.0]]), np.array([1.0, 0.0]), 0.2)
    np.testing.assert_allclose(filter.velocity, [0.3, 0.0, 0.0], atol=1e-3)


def test_a_swinging_foot_with_wrong_weight_is_gated_out() -> None:
    filter = RandomWalk(RandomWalkConfig())
    run(filter, np.tile([0.3, 0.0, 0.0], (2, 1)), BOTH, 0.2)
    run(filter, np.array([[0.3, 0.0, 0.0], [-2.0, 0.0, 0.0]]), BOTH, 0.2)
    np.testing.assert_allclose(filter.velocity, [0.3, 0.0, 0.0], atol=1e-3)


def test_a_foot_between_the_gates_counts_less_but_not_nothing() -> None:
    weights = []
    for distance in (0.1, 0.5):
        memory = new_record(FILTER)
        memory["options"], memory["variance"] = filter_options(RandomWalkConfig()), 0.001
        weights.append(fuse(memory[0], np.array([[distance, 0.0, 0.0], [0.0, 0.0, 0.0]]), BOTH, DT))
    assert weights[0][0] == pytest.approx(weights[0][1])
    assert 0.0 < weights[1][0] < 0.5 * weights[1][1]


def test_with_both_feet_gated_out_it_predicts_counts_the_time_and_comes_back() -> None:
    filter = RandomWalk(RandomWalkConfig())
    run(filter, np.tile([0.3, 0.0, 0.0], (2, 1)), BOTH, 0.2)
    jump = np.tile([4.0, 0.0, 0.0], (2, 1))
    filter.step(jump, BOTH, DT)
    np.testing.assert_allclose(filter.velocity, [0.3, 0.0, 0.0], atol=1e-3)
    assert filter.unmeasured == pytest.approx(DT)
    run(filter, jump, np.zeros(2), 0.1)
    assert filter.unmeasured == pytest.approx(0.1 + DT)
    # The uncertainty grows meanwhile, so that a change that lasts is believed in the end.
    run(filter, jump, BOTH, 3.0)
    np.testing.assert_allclose(filter.velocity, [4.0, 0.0, 0.0], atol=1e-2)


def test_many_robots_at_once_are_one_robot_many_times() -> None:
    rng = np.random.default_rng(0)
    n, steps = 5, 60
    many = RandomWalk(RandomWalkConfig(), (n,)), Contact(ContactConfig(), (n,))
    ones = [(RandomWalk(RandomWalkConfig()), Contact(ContactConfig())) for _ in range(n)]
    force = np.zeros((n, 2))
    for k in range(steps):
        R = np.linalg.qr(rng.standard_normal((n, 3, 3)))[0]
        omega, soles, rates = (rng.standard_normal(s) for s in ((n, 3), (n, 2, 3), (n, 2, 3)))
        force = force + 60.0 * rng.standard_normal((n, 2))
        if k == 30:
            chosen = np.array([True, False, True, False, False])
            for module in many:
                module.reset(chosen)
            for i in np.flatnonzero(chosen):
                for module in ones[i]:
                    module.reset()
        probability, weight = many[1].step(force, DT)
        velocity = many[0].step(base_velocity(R, omega, soles, rates), weight, DT)
        for i, (filter, contact) in enumerate(ones):
            p, w = contact.step(force[i], DT)
            v = filter.step(base_velocity(R[i], omega[i], soles[i], rates[i]), w, DT)
            np.testing.assert_allclose(probability[i], p)
            np.testing.assert_allclose(weight[i], w)
            np.testing.assert_allclose(velocity[i], v)


def test_a_mirrored_measurement_gives_the_mirrored_estimate() -> None:
    rng = np.random.default_rng(3)
    mirror = np.array([1.0, -1.0, 1.0])
    one, other = RandomWalk(RandomWalkConfig()), RandomWalk(RandomWalkConfig())
    for _ in range(100):
        measured, weight = 0.3 * rng.standard_normal((2, 3)), rng.uniform(size=2)
        v = one.step(measured, weight, DT)
        m = other.step(measured[::-1] * mirror, weight[::-1], DT)
        np.testing.assert_allclose(v * mirror, m, atol=1e-12)


def test_a_reset_forgets_what_is_no_number() -> None:
    filter = RandomWalk(RandomWalkConfig(), (3,))
    filter.step(np.full((3, 2, 3), np.nan), np.ones((3, 2)), 0.002)
    assert np.isnan(filter.velocity).all()
    filter.reset(np.array([True, False, True]))
    assert np.isfinite(filter.velocity).all(axis=1).tolist() == [True, False, True]
    assert np.isfinite(filter.variance).tolist() == [True, False, True]
    filter.reset()
    assert not filter.velocity.any() and np.isfinite(filter.variance).all()
