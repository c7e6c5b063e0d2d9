from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.hardware.safety.base import SafetyLimits
from golem.robots.model.table import JOINT_NAMES, load_limits


@pytest.mark.parametrize("profile", ["urdf", "paper"])
def test_limits_are_ninety_percent_of_the_profile(profile: str) -> None:
    vendor, safety = load_limits(profile), SafetyLimits.from_profile(profile)
    np.testing.assert_allclose(safety.velocity, 0.9 * vendor.velocity)
    np.testing.assert_allclose(safety.torque, 0.9 * vendor.torque)
    np.testing.assert_allclose(safety.upper - safety.lower, 0.9 * (vendor.upper - vendor.lower))
    np.testing.assert_allclose(safety.upper + safety.lower, vendor.upper + vendor.lower)


def test_the_default_profile_bounds_the_elbow_at_its_urdf_torque() -> None:
    elbow = JOINT_NAMES.index("left_elbow_joint")
    assert SafetyLimits.from_profile().torque[elbow] == pytest.approx(16.2)


def test_damping_breaks_no_torque_limit_at_any_legal_speed(limits: SafetyLimits) -> None:
    assert np.all(limits.damping * limits.velocity <= limits.torque_command * (1 + 1e-12))
    assert np.all(limits.damping > 0)


def test_limits_cannot_be_written(limits: SafetyLimits) -> None:
    with pytest.raises(ValueError, match="read-only"):
        limits.torque[0] = 1e9


def test_an_unknown_profile_names_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match="urdf"):
        SafetyLimits.from_profile("urfd")
