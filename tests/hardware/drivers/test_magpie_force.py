from __future__ import annotations

import numpy as np
import pytest

from golem.hardware.drivers.magpie_servos import force_from_load, load_from_force
from golem.hardware.hands.magpie import FORCE_STEP, clamp_force
from golem.robots.model.magpie_model import MAX_FORCE, MIN_FORCE


def test_the_law_is_the_labs() -> None:
    assert force_from_load(50) == pytest.approx(0.0025 * 50 - 7e-7 * 50**2)
    assert force_from_load(500) == pytest.approx(-1.889e-5 * 500**2 + 0.038399 * 500 - 3.4073)
    assert force_from_load(0) == 0.0 and force_from_load(1023) == MAX_FORCE


def test_more_load_is_no_less_force() -> None:
    forces = [force_from_load(load) for load in range(1024)]
    assert all(a <= b for a, b in zip(forces, forces[1:], strict=False))
    assert all(a < b for a, b in zip(forces[:990], forces[1:990], strict=False))


def test_every_force_that_can_be_commanded_is_met_within_half_a_step() -> None:
    steps = np.arange(0.0, MAX_FORCE - MIN_FORCE, FORCE_STEP)
    limits = []
    for force in (clamp_force(MIN_FORCE + step) for step in steps):
        limits.append(load_from_force(force))
        assert abs(force_from_load(limits[-1]) - force) <= 0.5 * FORCE_STEP
    assert all(a < b for a, b in zip(limits, limits[1:], strict=False))  # so each step is a step
    assert limits[0] == 61 and 0 < load_from_force(MAX_FORCE) <= 1016
