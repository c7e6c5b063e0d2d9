from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from golem.hardware.servo.gains import default_gains
from golem.robots.model.table import load_limits
from golem.types import LEGS, UPPER


def test_left_and_right_are_alike() -> None:
    gains = default_gains()
    for array in (gains.kp, gains.kd, gains.ki, gains.bias):
        np.testing.assert_array_equal(array[0:6], array[6:12])
        np.testing.assert_array_equal(array[13:20], array[20:27])


def test_legs_have_the_published_walking_gains(shared: Path) -> None:
    gains = default_gains()
    joints = json.loads((shared / "h12" / "h12_facts.json").read_text())["joints"][LEGS]
    assert gains.kp[LEGS].tolist() == [j["gains"]["hams_walk"]["kp"] for j in joints]
    assert gains.kd[LEGS].tolist() == [j["gains"]["hams_walk"]["kd"] for j in joints]


def test_the_bias_is_a_fraction_of_the_torque_limit() -> None:
    share = default_gains().bias / load_limits("urdf").torque
    assert np.all(share <= 0.3 + 1e-9)
    assert np.all(share[UPPER] >= 0.1)
