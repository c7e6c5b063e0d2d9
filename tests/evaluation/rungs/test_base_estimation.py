"""Judging base estimators: the spoilt sensors say what they should, and the shipped estimators meet their targets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from tests.hardware.estimator.sensed_feet import Feet, base_velocity

from golem.capabilities.legs.hold import STANCES
from golem.errors import ConfigError
from golem.evaluation.base import TrialSpec
from golem.evaluation.harness.ladder import LadderConfig, run_ladder
from golem.evaluation.rungs import base_estimation as walks
from golem.evaluation.rungs.base_estimation import BaseEstimation, RecordedWalk, _way, follow, slipping, wrong_contacts
from golem.hardware.estimator.feet import FeetConfig
from golem.robots.model.leg_kernel import LegDynamics
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


def test_the_way_is_that_of_the_first_heading() -> None:
    T = np.tile(np.eye(4), (3, 1, 1))
    T[0, :3, :3] = rotation_rpy(0.0, 0.0, 1.0)
    T[2, :3, :3] = rotation_rpy(0.0, 0.0, 1.5)
    T[2, :3, 3] = T[0, :3, :3] @ [2.0, 1.0, 0.0]
    np.testing.assert_allclose(_way(T, 0, 2), [2.0, 1.0, 0.5])


def test_wrong_estimators_are_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="Unknown method 'ekf'; valid: invariant_ekf, random_walk_kf"):
        run_ladder(LadderConfig(rung="base-estimation", method=("ekf",), out=tmp_path / "run"))


def trial(method: str, condition: str = "nominal") -> TrialSpec:
    return TrialSpec("base-estimation", method, "ideal", 0, 0, case={"condition": condition})


def test_an_estimator_is_judged_on_the_velocity_and_what_depends_on_the_machine_is_kept_apart(
    gliding: RecordedWalk,
) -> None:
    outcome = follow(trial("random_walk_kf"), gliding)
    assert (outcome.success, outcome.stage, outcome.module) == (False, "velocity", "estimator: random_walk_kf")
    assert outcome.series["velocity_walking"] == pytest.approx(0.5, abs=0.05), "joints at rest hide the motion"
    assert outcome.series["distance"] == pytest.approx(1.0, abs=0.05)
    assert set(outcome.costs) == {"tick", "tick_p99"} and not set(outcome.costs) & set(outcome.series)


@pytest.mark.slow
def test_the_estimators_meet_their_target_on_a_short_walk(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walks, "TWISTS", walks.TWISTS[:1])
    rung = BaseEstimation()
    specs = [
        TrialSpec("base-estimation", m, "field", 0, 0, case={"condition": "nominal"}) for m in rung.default_methods
    ]
    for outcome in rung.run_together(specs):
        series = outcome.series
        assert outcome.success and series["distance"] > 0.5
        assert series["velocity_walking"] < 0.05 and series["velocity_standing"] < 0.02
