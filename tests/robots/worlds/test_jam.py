"""Screws come out of their bores when pulled straight and jam when pulled off axis."""

from __future__ import annotations

import numpy as np
import pytest
from tests.robots.worlds.gripper import nominal, nominal_nut, pull


@pytest.mark.parametrize(("friction", "tilt"), [(0.6, 0.0), (0.35, 10.0), (0.15, 20.0)])
def test_out(friction: float, tilt: float) -> None:
    assert pull(nominal(friction), np.deg2rad(tilt)).rise > 0.025


@pytest.mark.parametrize(
    ("friction", "tilt", "clearance"), [(0.35, 25.0, 0.0003), (0.6, 15.0, 0.0003), (0.35, 15.0, 0.0001)]
)
def test_jam(friction: float, tilt: float, clearance: float) -> None:
    result = pull(nominal(friction, clearance=clearance), np.deg2rad(tilt))
    assert result.rise < 0.003
    assert result.slip > 0.010


def test_a_nut_comes_off_askew_and_jams_far_askew() -> None:
    assert pull(nominal_nut(0.6), np.deg2rad(30.0)).rise > 0.02
    jammed = pull(nominal_nut(0.6), np.deg2rad(55.0))
    assert jammed.rise < 0.003 and jammed.slip > 0.010
