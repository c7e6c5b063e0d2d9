"""The trim: a robot that under-tracks arrives at the twist that was wanted."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.legs.balance_errors import VelocityIntegrator, VelocityIntegratorConfig, step_trim
from golem.types import Array

DT = 0.01


def trimmed(trim: VelocityIntegrator, wanted: Array, R: Array, velocity: Array, turn: float) -> Array:
    out = np.empty(3)
    step_trim(trim.memory[0], wanted, R, velocity, turn, DT, out)
    return out


def walk(trim: VelocityIntegrator, wanted: Array, seconds: float, yaw: float = 0.0, push: float = 0.0) -> Array:
    """Let a robot at heading `yaw` walk that does 85 % of what it is told and drifts; return its last twist."""
    c, s = np.cos(yaw), np.sin(yaw)
    R = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    done = np.zeros(3)
    for k in range(round(seconds / DT)):
        velocity = R @ np.array([done[0] + push * (k < 100), done[1], 0.0])
        told = trimmed(trim, wanted, R, velocity, float(done[2]))
        done = 0.85 * told + np.array([0.0, -0.02, 0.01])
    return done


@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_a_robot_that_falls_short_and_drifts_arrives_at_the_wanted_twist(yaw: float) -> None:
    wanted = np.array([0.6, -0.2, 0.4])
    assert np.abs(walk(VelocityIntegrator(), wanted, 0.1, yaw) - wanted).max() > 0.08
    np.testing.assert_allclose(walk(VelocityIntegrator(), wanted, 12.0, yaw), wanted, atol=0.005)


def test_a_push_hardly_counts() -> None:
    config = VelocityIntegratorConfig()
    trim = VelocityIntegrator(config)
    walk(trim, np.zeros(3), 1.0, push=1.5)
    told = trimmed(trim, np.zeros(3), np.eye(3), np.zeros(3), 0.0)
    assert np.abs(told[0]) <= config.gain * config.heed[0] * 1.0 + 1e-9


def test_the_correction_is_bounded_and_forgotten() -> None:
    trim = VelocityIntegrator()
    wanted = np.array([0.5, 0.0, 0.0])
    for _ in range(2000):
        told = trimmed(trim, wanted, np.eye(3), np.zeros(3), 0.0)
    np.testing.assert_allclose(told - wanted, [VelocityIntegratorConfig().maximum[0], 0.0, 0.0])
    trim.reset()
    assert np.abs(trimmed(trim, wanted, np.eye(3), np.zeros(3), 0.0) - wanted).max() < 1e-3
