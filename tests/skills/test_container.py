"""What a hand's error at one object says of the container."""

from __future__ import annotations

import numpy as np
import pytest

from golem.skills.container import shift_of, wall_between

ROW = np.array([[0.43, y, -0.03] for y in (-0.2, -0.1, 0.0)])


@pytest.mark.parametrize(
    ("off", "shift"),
    [
        ((0.03, 0.019, 0.01), (0.03, 0.019, 0.01)),
        ((0.03, -0.04, 0.01), (0.03, 0.0, 0.01)),
        ((-0.02, 0.045, 0.0), (-0.02, 0.0, 0.0)),
    ],
)
def test_only_what_cannot_be_a_neighbour_counts(off: tuple[float, ...], shift: tuple[float, ...]) -> None:
    np.testing.assert_allclose(shift_of(ROW[1] + off, ROW[1], ROW), shift, atol=1e-12)


def test_a_single_object_has_no_neighbour() -> None:
    np.testing.assert_allclose(shift_of(ROW[0] + 0.05, ROW[0], ROW[:1]), [0.05] * 3)


@pytest.mark.parametrize(("x", "wall"), [(0.35, 0.05), (0.41, -0.01), (0.45, None)])
def test_a_hand_outside_has_a_wall_before_it(x: float, wall: float | None) -> None:
    rng = np.random.default_rng(0)
    floor = np.column_stack([rng.uniform(0.3, 0.6, (2000, 2)) - (0.0, 0.5), np.zeros(2000)])
    side = np.column_stack([np.full(500, 0.40), rng.uniform(-0.1, 0.1, 500), rng.uniform(0.0, 0.045, 500)])
    finger = rng.normal((x, 0.0, 0.10), 0.005, (500, 3))
    cloud = np.concatenate([floor, side, finger])
    found = wall_between(cloud, np.array([x, 0.0, 0.1]), np.array([0.5, 0.0, 0.0]), 0.0)
    assert found == (None if wall is None else pytest.approx(wall, abs=0.003))


def test_a_hand_in_the_middle_asks_for_no_way() -> None:
    assert wall_between(np.zeros((50, 3)), np.zeros(3), np.zeros(3), -0.04) is None
