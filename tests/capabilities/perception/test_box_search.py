"""A tray that the head camera saw is found in a view of the palm camera that fingers cut in two."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.perception.box_search import SEARCHED, find_box
from golem.capabilities.perception.open_box import OpenBox
from golem.types import Array

SIZE = np.array([0.14, 0.22])
THERE = np.array([0.45, 0.10])
YAW = 0.3
RIM, LEVEL = 0.045, 0.010


def view(there: Array = THERE, cut: float = 0.0, fingers: bool = True, yaw: float = YAW, pack: float = 0.0) -> Array:
    """Return (n, 3) points around a tray [m], `cut` from its end on not in view; behind fingers nothing is."""
    rng = np.random.default_rng(3)
    flat = rng.uniform(-0.25, 0.25, (60_000, 2))
    sides = np.abs(flat) - 0.5 * SIZE
    z = np.where((sides < -0.004).all(axis=1), LEVEL, np.where((sides < 0.0).all(axis=1), RIM, pack))
    seen = flat[:, 1] < 0.5 * SIZE[1] - cut
    if fingers:
        seen &= np.abs(flat[:, 1] + 0.01) > 0.025
    c, s = np.cos(yaw), np.sin(yaw)
    points = np.column_stack([flat @ np.array([[c, s], [-s, c]]) + there, z])
    return points[seen] + rng.normal(0.0, 0.0015, (int(seen.sum()), 3))


def known(off: Array, raised: float = 0.0) -> OpenBox:
    """Return the tray as a head camera saw it, `off` (2,) beside where it is [m]."""
    return OpenBox(THERE + off, YAW + 0.03, SIZE + (0.004, -0.006), RIM + raised, LEVEL + raised)


@pytest.mark.parametrize("off", [(0.0, 0.0), (0.05, -0.03), (-0.06, 0.05), (0.02, 0.06)])
@pytest.mark.parametrize("cut", [0.0, 0.08])
@pytest.mark.parametrize("pack", [-0.4, 0.0, 0.03])
def test_the_middle_is_found_behind_fingers_and_where_the_view_ends(
    off: tuple[float, float], cut: float, pack: float
) -> None:
    found = find_box(known(np.array(off), raised=-0.02), view(cut=cut, pack=pack), [THERE + off])
    assert found is not None
    assert np.linalg.norm(found.center - THERE) < 0.02  # a hand that is 3 cm off goes no nearer
    assert found.rim == pytest.approx(RIM, abs=0.01) and found.level == pytest.approx(LEVEL, abs=0.01)
    assert (found.yaw, *found.size) == (YAW + 0.03, *known(np.zeros(2)).size)


def test_a_tray_that_is_farther_off_or_hardly_in_view_is_not_found() -> None:
    assert find_box(known(np.zeros(2)), view(), [THERE + (0.0, 3.0 * SEARCHED)]) is None
    assert find_box(known(np.zeros(2)), view(cut=0.19), [THERE]) is None
    assert find_box(known(np.zeros(2)), np.zeros((0, 3)), [THERE]) is None


def test_of_several_places_that_a_detector_names_the_likest_counts() -> None:
    halves = [THERE + (0.02, 0.06), THERE + (-0.02, -0.06), THERE + (0.3, 0.3)]
    for around in (halves, halves[::-1]):
        found = find_box(known(np.array([0.1, 0.15])), view(), around)
        assert found is not None and np.linalg.norm(found.center - THERE) < 0.02


def test_a_plane_and_a_step_are_no_tray() -> None:
    rng = np.random.default_rng(4)
    flat = rng.uniform(-0.25, 0.25, (60_000, 2)) + THERE
    for z in (np.full(len(flat), RIM), np.where(flat[:, 0] > THERE[0], RIM, LEVEL)):
        assert find_box(known(np.zeros(2)), np.column_stack([flat, z]), [THERE]) is None
