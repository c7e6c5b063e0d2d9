from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.legs.base import LocomotionCommand, LowerBody
from golem.capabilities.legs.hold import STANCES, HoldConfig, JointHold, squat
from golem.errors import ConfigError
from golem.robots.model.leg_kinematics import leg_poses, sole_centers
from golem.robots.model.table import load_limits
from golem.types import LEGS, NUM_JOINTS, BaseEstimate, Imu, LowState, Twist

BASE = BaseEstimate(0.0, np.eye(4))


def state(q: float) -> LowState:
    zero = np.zeros(NUM_JOINTS)
    imu = Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.array([0, 0, 9.81]))
    return LowState(0.0, np.full(NUM_JOINTS, q), zero, zero, imu)


def test_moves_to_the_stance_without_a_step_and_stays() -> None:
    hold = JointHold(HoldConfig(speed=0.5))
    assert isinstance(hold, LowerBody)
    hold.reset(state(0.1))
    previous = np.full(12, 0.1)
    for _ in range(100):
        command = hold.step(state(0.1), BASE, LocomotionCommand(Twist(1.0, 0.0, 0.0), np.zeros(2), True, True), 0.02)
        assert np.abs(command.q - previous).max() <= 0.5 * 0.02 + 1e-12
        previous = command.q
    np.testing.assert_allclose(previous, np.tile(STANCES["stand"], 2))


@pytest.mark.parametrize("name", STANCES)
def test_stances_lie_within_the_limits(name: str) -> None:
    limits = load_limits()
    q = np.tile(STANCES[name], 2)
    assert (q >= limits.lower[LEGS]).all() and (q <= limits.upper[LEGS]).all()


def test_wrong_options_are_named() -> None:
    with pytest.raises(ConfigError, match="crouch"):
        JointHold(HoldConfig(stance="crouhc"))
    with pytest.raises(ConfigError, match="six"):
        JointHold(HoldConfig(kp=(1.0, 2.0)))
    with pytest.raises(ConfigError, match="speed"):
        JointHold(HoldConfig(speed=0.0))


@pytest.mark.parametrize("height", [0.75, 0.8, 0.965, 1.02])
def test_a_squat_stands_at_its_height_with_level_soles(height: float) -> None:
    q = squat(height)
    p, R = leg_poses(q)
    assert sole_centers(p, R)[:, 2] == pytest.approx([-height] * 2, abs=2e-4)
    assert np.allclose(R, np.eye(3))
    assert squat(0.9)[3] < squat(0.8)[3]
