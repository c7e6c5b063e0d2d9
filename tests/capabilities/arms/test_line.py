from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from golem.capabilities.arms.base import TargetError
from golem.capabilities.arms.line import Line
from golem.errors import ConfigError
from golem.types import Array

vector = st.lists(st.floats(-1.0, 1.0), min_size=3, max_size=3).map(np.array)
limit = st.floats(0.05, 2.0)


def pose(p: Array, w: Array) -> Array:
    return pin.SE3(pin.exp3(w), p).homogeneous


@given(p0=vector, p1=vector, w0=vector, w1=vector, v=limit, w=limit, a=limit, alpha=limit)
def test_speed_and_acceleration_stay_bounded_and_the_ends_are_exact(
    p0: Array, p1: Array, w0: Array, w1: Array, v: float, w: float, a: float, alpha: float
) -> None:
    start, goal = pose(p0, w0), pose(p1, w1)
    line = Line(start, goal, v_max=v, w_max=w, a_max=a, alpha_max=alpha)
    np.testing.assert_array_equal(line.pose(line.duration), goal)
    np.testing.assert_array_equal(line.pose(line.duration + 1.0), goal)
    if line.duration == 0.0:
        np.testing.assert_allclose(start, goal, atol=1e-8)
        return
    np.testing.assert_array_equal(line.pose(0.0), start)
    s = np.array([line.fraction(t) for t in np.linspace(0.0, line.duration, 201)])
    h = line.duration / 200
    ds, dds = np.diff(s) / h, np.diff(s, 2) / h**2
    assert (ds >= -1e-9).all()
    assert ds.max() * line.length <= v * (1 + 1e-6) + 1e-9
    assert ds.max() * line.angle <= w * (1 + 1e-6) + 1e-9
    assert np.abs(dds).max() * line.length <= a * (1 + 1e-3) + 1e-6
    assert np.abs(dds).max() * line.angle <= alpha * (1 + 1e-3) + 1e-6


@given(p0=vector, p1=vector, w0=vector, w1=vector, at=st.floats(0.0, 1.0))
def test_straight_in_position_and_geodesic_in_rotation(p0: Array, p1: Array, w0: Array, w1: Array, at: float) -> None:
    start, goal = pose(p0, w0), pose(p1, w1)
    line = Line(start, goal)
    t = at * line.duration
    T, s = line.pose(t), line.fraction(t)
    np.testing.assert_allclose(T[:3, 3], p0 + s * (p1 - p0), atol=1e-8)
    turned = float(np.linalg.norm(pin.log3(start[:3, :3].T @ T[:3, :3])))
    assert turned == pytest.approx(s * line.angle, abs=1e-6)


def test_a_long_line_cruises_and_takes_the_textbook_time() -> None:
    line = Line(np.eye(4), pose(np.array([1.0, 0, 0]), np.zeros(3)), v_max=0.25, a_max=0.5)
    assert line.duration == pytest.approx(1.0 / 0.25 + 0.25 / 0.5)


def test_a_short_line_never_cruises() -> None:
    line = Line(np.eye(4), pose(np.array([0.02, 0, 0]), np.zeros(3)), v_max=0.25, a_max=0.5)
    assert line.duration == pytest.approx(2 * np.sqrt(0.02 / 0.5))


def test_no_way_takes_no_time() -> None:
    line = Line(np.eye(4), np.eye(4))
    assert line.duration == 0.0
    np.testing.assert_array_equal(line.pose(0.0), np.eye(4))


def test_wrong_input_is_refused() -> None:
    with pytest.raises(ConfigError, match="positive"):
        Line(np.eye(4), np.eye(4), v_max=0.0)
    with pytest.raises(TargetError, match="goal of the line"):
        Line(np.eye(4), np.full((4, 4), np.nan))
