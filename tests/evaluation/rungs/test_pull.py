"""How straight a pull was, from the poses of the hand."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.arms.postures import downward
from golem.evaluation.rungs.pick_screw import straightness
from golem.types import Array


def poses(*rows: tuple[float, float]) -> list[Array]:
    """Return poses beside the line and along it [m]."""
    return [downward(0.4 + x, 0.0, z, 0.0) for x, z in rows]


def test_a_straight_pull_is_straight() -> None:
    assert straightness(poses((0, 0), (0, 0.03), (0, 0.06))) == pytest.approx((0.0, 0.0), abs=1e-7)


def test_the_largest_deviation_counts_and_what_comes_after_does_not() -> None:
    pull = poses((0, 0), (0.002, 0.03), (0.001, 0.055), (0.5, 0.2), (0.5, 0.05))
    assert straightness(pull) == pytest.approx((0.002, 0.0), abs=1e-7)


def test_a_hand_that_turns_is_found() -> None:
    pull = poses((0, 0), (0, 0.03))
    c, s = np.cos(0.1), np.sin(0.1)
    pull[1][:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ pull[1][:3, :3]
    measured = straightness(pull)
    assert measured is not None and measured[1] == pytest.approx(0.1)


def test_no_pull_has_no_straightness() -> None:
    assert straightness([]) is None
    assert straightness(poses((0, 0), (0, 0.0005))) is None
