from __future__ import annotations

import numpy as np
import pytest

from golem.errors import ConfigError
from golem.robots.model import mjcf
from golem.robots.model.table import JOINT_INDEX, load_limits


def test_default_is_the_lower_of_the_two_sources() -> None:
    default, paper = load_limits(), load_limits("paper")
    assert np.all(default.torque < paper.torque)
    assert default.torque[JOINT_INDEX["left_elbow_joint"]] == 18.0
    assert paper.torque[JOINT_INDEX["left_elbow_joint"]] == 120.0
    np.testing.assert_array_equal(default.lower, paper.lower)
    np.testing.assert_array_equal(default.velocity, paper.velocity)


def test_left_and_right_mirror_each_other() -> None:
    limits = load_limits()
    for name, i in JOINT_INDEX.items():
        if not name.startswith("left_"):
            continue
        j = JOINT_INDEX[name.replace("left_", "right_", 1)]
        assert limits.torque[i] == limits.torque[j]
        assert limits.velocity[i] == limits.velocity[j]
        mirrored = "yaw" in name or "roll" in name
        expected = (-limits.upper[i], -limits.lower[i]) if mirrored else (limits.lower[i], limits.upper[i])
        assert (limits.lower[j], limits.upper[j]) == expected, name


def test_the_profile_reaches_the_motors() -> None:
    for profile in ("urdf", "paper"):
        model = mjcf.robot_spec(hands=False, torque=profile).compile()
        np.testing.assert_array_equal(model.actuator_ctrlrange[:, 1], load_limits(profile).torque)


def test_unknown_profile_names_the_valid_ones() -> None:
    with pytest.raises(ConfigError, match=r"'papper'; valid: paper, urdf\. Did you mean 'paper'\?"):
        load_limits("papper")
