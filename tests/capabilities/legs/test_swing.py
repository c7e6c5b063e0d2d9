from __future__ import annotations

import numpy as np

from golem.capabilities.legs.gait import LIFT, rise, swing_offset, swing_share

STIFF = np.zeros(12)
"""Lag of joints that follow at once [s]."""


def test_a_leg_in_stance_is_left_alone_and_a_swinging_one_is_lifted() -> None:
    offset = swing_offset(np.array([0.3, 0.8]), 0.7, 0.6, 0.25, STIFF)
    np.testing.assert_array_equal(offset[:6], 0.0)
    np.testing.assert_allclose(offset[6:], [0, -0.25, 0, 0.5, -0.25, 0])


def test_the_foot_stays_level() -> None:
    phase = np.stack([np.linspace(0, 1, 50), np.linspace(0, 1, 50)], axis=-1)
    offset = swing_offset(phase, 0.7, 0.55, 0.3, STIFF).reshape(50, 2, 6)
    np.testing.assert_allclose(offset[..., 1] + offset[..., 3] + offset[..., 4], 0.0, atol=1e-15)


def test_the_lift_begins_and_ends_at_zero_and_at_rest() -> None:
    step = 1e-4
    ends = np.array([[p, 0.0] for p in (0.55, 0.55 + step, 1.0 - step)])
    # At rest: of the second order in the distance from the end. The half sine would be 100 times as far.
    np.testing.assert_allclose(swing_offset(ends, 0.7, 0.55, 0.3, STIFF), 0.0, atol=20.0 * step**2 / 0.45**2)


def test_many_robots_are_many_single_ones() -> None:
    phase = np.random.default_rng(1).uniform(size=(5, 3, 2))
    many = swing_offset(phase, 0.7, 0.55, 0.3, STIFF)
    assert many.shape == (5, 3, 12)
    np.testing.assert_array_equal(many[4, 1], swing_offset(phase[4, 1], 0.7, 0.55, 0.3, STIFF))


def test_the_compiled_swing_is_that_of_the_description() -> None:
    rng, period, stance, amplitude = np.random.default_rng(2), 0.64, 0.55, 0.3
    phase, lag = rng.uniform(size=(200, 2)), rng.uniform(0.0, 0.1, 12)
    swing = swing_share(phase, stance)[..., None]
    speed = np.pi / ((1.0 - stance) * period) * np.sin(2.0 * np.pi * swing)
    expected = amplitude * (rise(swing) + speed * lag.reshape(2, 6)) * LIFT
    given = swing_offset(phase, period, stance, amplitude, lag).reshape(200, 2, 6)
    np.testing.assert_allclose(given, expected, rtol=0.0, atol=1e-12)


def test_joints_that_lag_follow_the_motion_that_was_meant() -> None:
    period, stance, dt = 0.64, 0.55, 1e-4
    lag = np.tile([0.0125, 0.0125, 0.0125, 0.0133, 0.1, 0.1], 2)
    q = np.zeros(12)
    for k in range(round((1.0 - stance) * period / dt)):
        phase = np.array([stance + k * dt / period, 0.0])
        q = q + dt / lag * (swing_offset(phase, period, stance, 0.28, lag) - q)  # damping against stiffness
        meant = swing_offset(phase, period, stance, 0.28, STIFF)
        np.testing.assert_allclose(q, meant, atol=1e-3)
