"""Judging base estimators: the spoilt sensors say what they should, and the shipped estimators meet their targets."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.legs.hold import STANCES
from golem.errors import ConfigError
from golem.evaluation.episodes import walk_dataset as walks
from golem.evaluation.episodes.walk_dataset import RecordedWalk, slipping, wrong_contacts
from golem.evaluation.estimation import EstimationConfig, _longest, _way, run_estimation
from golem.hardware.estimator.feet import Feet, FeetConfig
from golem.hardware.estimator.random_walk import base_velocity
from golem.robots.model.leg_dynamics import LegDynamics
from golem.robots.model.spatial import rotation_rpy
from golem.types import LEGS, NUM_JOINTS, Array, Imu, LowState

DT = 0.002
UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture
def gliding() -> RecordedWalk:
    """A robot that leans on its left leg with 600 N and glides ahead at 0.5 m/s, its joints at rest."""
    q, n = np.zeros(NUM_JOINTS), 1500
    q[LEGS] = np.tile(STANCES["crouch"], 2)
    legs = LegDynamics()
    legs.update(q[LEGS], np.zeros(12))
    tau = np.zeros(NUM_JOINTS)
    tau[LEGS] = legs.gravity(q[LEGS], -9.81 * UP).ravel()
    tau[:6] -= legs.jacobians[0, :3].T @ (600.0 * UP)
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), 9.81 * UP)
    T = np.tile(np.eye(4), (n, 1, 1))
    velocity = np.tile([0.5, 0.0, 0.0], (n, 1))
    T[:, 0, 3] = 0.5 * DT * np.arange(n)
    return RecordedWalk(
        states=[LowState(i * DT, q, np.zeros(NUM_JOINTS), tau, imu) for i in range(n)],
        T=T,
        velocity=velocity,
        forces=np.tile([600.0, 0.0], (n, 1)),
        judged=np.ones(n, dtype=bool),
        stepping=np.ones(n, dtype=bool),
        lost="",
    )


def sensed(states: list[LowState]) -> tuple[Array, Array]:
    """Return contact probabilities (n, 2) and implied velocities (n, 2, 3)."""
    feet, contact, velocity = Feet(FeetConfig()), [], []
    for state in states:
        feet.step(state, UP, state.imu.gyro, DT)
        contact.append(feet.contact)
        velocity.append(base_velocity(np.eye(3), state.imu.gyro, feet.points, feet.rates))
    return np.array(contact), np.array(velocity)


def test_wrong_contacts_hide_a_foot_that_carries_and_invent_one_that_does_not(gliding: RecordedWalk) -> None:
    contact, _ = sensed(wrong_contacts(gliding, np.random.default_rng(0)))
    right, wrong = contact[:, 0] > 0.9, contact[:, 0] == 0.0
    assert (right | wrong).mean() > 0.97
    # One spell a second of 0.15 s, three seconds: some, not most of the time.
    assert 0.05 < wrong.mean() < 0.4
    assert 0.05 < (contact[:, 1] > 0.9).mean() < 0.4
    assert not np.array_equal(wrong, contact[:, 1] > 0.9)


def test_a_foot_that_slips_makes_the_base_seem_a_tenth_faster(gliding: RecordedWalk) -> None:
    still = sensed(gliding.states)[1]
    slipped = sensed(slipping(gliding, np.random.default_rng(0)))[1]
    # A tenth of 0.5 m/s more than joints at rest say, for the planted foot alone.
    np.testing.assert_allclose(slipped[10:200, 0, 0] - still[10:200, 0, 0], 0.05, atol=0.002)
    np.testing.assert_allclose(slipped[:, 1], still[:, 1], atol=1e-9)


def test_the_longest_spell_and_the_way() -> None:
    assert _longest(np.array([0, 1, 1, 0, 1, 1, 1, 0, 1], dtype=bool)) == 3
    assert _longest(np.zeros(4, dtype=bool)) == 0
    T = np.tile(np.eye(4), (3, 1, 1))
    T[0, :3, :3] = rotation_rpy(0.0, 0.0, 1.0)
    T[2, :3, :3] = rotation_rpy(0.0, 0.0, 1.5)
    T[2, :3, 3] = T[0, :3, :3] @ [2.0, 1.0, 0.0]
    np.testing.assert_allclose(_way(T, 0, 2), [2.0, 1.0, 0.5])


@pytest.mark.parametrize(
    "config", [EstimationConfig(n=0), EstimationConfig(seed=-1), EstimationConfig(estimator=("ekf",))]
)
def test_bad_options_are_refused(config: EstimationConfig) -> None:
    with pytest.raises(ConfigError):
        run_estimation(config)


@pytest.mark.slow
def test_the_estimators_meet_their_target_on_a_short_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walks, "TWISTS", walks.TWISTS[:1])
    rows = run_estimation(EstimationConfig(n=1))
    nominal = {row.estimator: row for row in rows if row.condition == "nominal"}
    for row in nominal.values():
        assert row.distance > 0.5
        assert row.walking is not None and row.standing is not None and row.drift is not None
        assert row.walking < 0.05 and row.standing < 0.02 and row.drift < 0.05
