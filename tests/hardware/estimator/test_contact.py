"""Contact probabilities from foot forces: hysteresis, and no trust right after touch-down."""

from __future__ import annotations

import numpy as np
import pytest

from golem.hardware.estimator.feet import Contact, ContactConfig

DT = 0.002


def hold(contact: Contact, left: float, right: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    out = np.zeros(2), np.zeros(2)
    for _ in range(round(seconds / DT)):
        out = contact.step(np.array([left, right]), DT)
    return out


def test_a_standing_robot_is_believed_from_the_first_sample() -> None:
    probability, weight = Contact(ContactConfig()).step(np.array([330.0, 330.0]), DT)
    assert np.all(probability > 0.99)
    np.testing.assert_array_equal(weight, probability)


def test_a_hanging_foot_has_no_contact() -> None:
    probability, weight = Contact(ContactConfig()).step(np.array([-10.0, 5.0]), DT)
    assert not probability.any() and not weight.any()


def test_a_foot_that_lands_carries_at_once_but_is_believed_later() -> None:
    config = ContactConfig()
    contact = Contact(config)
    hold(contact, 600.0, 0.0, 0.1)
    probability, weight = hold(contact, 300.0, 300.0, 0.5 * config.settle)
    assert probability[1] > 0.9 and weight[1] == 0.0 and weight[0] > 0.9
    assert 0.0 < hold(contact, 300.0, 300.0, 0.5 * config.settle + 0.5 * config.ramp)[1][1] < probability[1]
    assert hold(contact, 300.0, 300.0, config.ramp)[1][1] > 0.98


def test_the_force_must_fall_well_below_the_threshold_before_the_foot_has_left() -> None:
    config = ContactConfig()
    contact = Contact(config)
    between = 0.5 * (config.touch + config.leave)
    assert not hold(contact, 300.0, between, 0.1)[0][1]
    hold(contact, 300.0, 300.0, 0.1)
    assert hold(contact, 300.0, between, 0.1)[0][1] > 0.1
    assert not hold(contact, 300.0, 0.5 * config.leave, 0.1)[0][1]


def test_a_foot_that_chatters_stays_unbelieved() -> None:
    contact = Contact(ContactConfig())
    hold(contact, 600.0, 0.0, 0.1)
    for _ in range(20):
        _, weight = hold(contact, 600.0, 300.0, 0.02)
        assert weight[1] == 0.0
        hold(contact, 600.0, 0.0, 0.02)


def test_more_force_is_more_probable() -> None:
    config = ContactConfig()
    forces = np.linspace(config.touch + 1.0, config.middle + 10.0 * config.width, 8)
    probabilities = [Contact(config).step(np.array([f, f]), DT)[0][0] for f in forces]
    assert probabilities == sorted(probabilities) and probabilities[0] > 0.2
    assert probabilities[-1] == pytest.approx(1.0, abs=1e-3)
