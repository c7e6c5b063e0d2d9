from __future__ import annotations

import numpy as np

from golem.capabilities.legs.swing import swing_offset


def test_a_leg_in_stance_is_left_alone_and_a_swinging_one_is_lifted() -> None:
    offset = swing_offset(np.array([0.3, 0.8]), 0.6, 0.25)
    np.testing.assert_array_equal(offset[:6], 0.0)
    np.testing.assert_allclose(offset[6:], [0, -0.25, 0, 0.5, -0.25, 0])


def test_the_foot_stays_level() -> None:
    phase = np.stack([np.linspace(0, 1, 50), np.linspace(0, 1, 50)], axis=-1)
    offset = swing_offset(phase, 0.55, 0.3).reshape(50, 2, 6)
    np.testing.assert_allclose(offset[..., 1] + offset[..., 3] + offset[..., 4], 0.0, atol=1e-15)


def test_the_lift_begins_and_ends_smoothly_at_zero() -> None:
    at = [0.55, 0.5500001, 0.9999999, 0.0]
    offset = swing_offset(np.array([[p, 0.0] for p in at]), 0.55, 0.3)
    np.testing.assert_allclose(offset, 0.0, atol=1e-5)


def test_many_robots_are_many_single_ones() -> None:
    phase = np.random.default_rng(1).uniform(size=(5, 3, 2))
    many = swing_offset(phase, 0.55, 0.3)
    assert many.shape == (5, 3, 12)
    np.testing.assert_array_equal(many[4, 1], swing_offset(phase[4, 1], 0.55, 0.3))
