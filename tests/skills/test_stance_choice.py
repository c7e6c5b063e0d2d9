"""Stances before a pack: within reach of what is wanted, and no further than needed."""

from __future__ import annotations

import numpy as np
import pytest

from golem.skills.stance_choice import STANDOFF, best_stance, stance_here
from golem.types import Array, PlanarPose

SCREWS = np.array([[0.43, 0.05 + 0.095 * k, -0.03] for k in range(-4, 5)])
WANTED = np.ones(len(SCREWS))
TRAY = np.array([0.48, -0.28, -0.02])
EDGE = PlanarPose(0.41, 0.0, 0.0)


def moved(points: Array, off: PlanarPose) -> Array:
    """Return what a robot sees of `points` that stands at `off` from where they are given."""
    T = np.linalg.inv(off.matrix())
    return points @ T[:3, :3].T + T[:3, 3]


def test_the_nominal_stance_serves_and_better_ones_are_near_it() -> None:
    here, best = stance_here(SCREWS, WANTED, TRAY), best_stance(EDGE, SCREWS, WANTED, TRAY)
    assert here.served >= 3 and here.quality > 0.1
    assert best.quality >= here.quality
    assert np.hypot(best.pose.x, best.pose.y) < 0.35


@pytest.mark.parametrize("off", [PlanarPose(-0.3, 0.1, 0.1), PlanarPose(-0.1, -0.5, 0.0), PlanarPose(0.05, 0.3, -0.2)])
def test_a_robot_that_stands_badly_is_sent_to_where_it_serves(off: PlanarPose) -> None:
    screws, tray = moved(SCREWS, off), moved(TRAY[None], off)[0]
    edge = off.to(EDGE)
    best = best_stance(edge, screws, WANTED, tray)
    there = stance_here(moved(screws, best.pose), WANTED, moved(tray[None], best.pose)[0])
    assert there.quality == pytest.approx(best.quality, abs=1e-9) and there.served == best.served >= 3
    assert there.quality > stance_here(screws, WANTED, tray).quality
    across = edge.to(best.pose)
    assert STANDOFF[0] - 1e-6 <= -across.x <= STANDOFF[1] + 1e-6


def test_what_is_wanted_most_decides() -> None:
    ends = np.array([[0.43, -0.6, -0.03], [0.43, 0.6, -0.03]])
    left = best_stance(EDGE, ends, np.array([0.1, 1.0]), None)
    right = best_stance(EDGE, ends, np.array([1.0, 0.1]), None)
    assert left.pose.y > 0.1 > -0.1 > right.pose.y


def test_without_a_fastener_in_reach_there_is_no_quality() -> None:
    far = np.array([[3.0, 0.0, 0.0]])
    assert stance_here(far, np.ones(1), None).quality == 0.0
    assert best_stance(EDGE, far, np.ones(1), None).served == 0


def test_a_low_pack_is_worked_at_from_lower_and_a_nominal_one_is_not() -> None:
    drops = (0.0, 0.06, 0.12, 0.18, -0.04)
    low, tray = SCREWS - (0.0, 0.0, 0.18), TRAY - (0.0, 0.0, 0.18)
    here = stance_here(low, WANTED, tray, drops)
    assert here.drop > 0.1 and here.quality > stance_here(low, WANTED, tray).quality + 0.1
    best = best_stance(EDGE, low, WANTED, tray, drops)
    assert best.drop > 0.05 and best.quality > best_stance(EDGE, low, WANTED, tray).quality
    nominal = best_stance(EDGE, SCREWS, WANTED, TRAY, drops)
    assert nominal == best_stance(EDGE, SCREWS, WANTED, TRAY)


def test_a_robot_stays_as_high_as_it_stands_where_another_height_wins_little_and_goes_by_the_hand_it_uses() -> None:
    drops = (-0.06, 0.0, 0.06)  # its own height is 6 cm above
    assert stance_here(SCREWS, WANTED, TRAY, drops).drop == 0.0
    assert stance_here(SCREWS, WANTED, TRAY, (0.0, -0.06, 0.06)).drop == 0.0
    left = SCREWS * (1.0, -1.0, 1.0)
    assert stance_here(left, WANTED, None, drops, ("left",)).served > 0
    assert stance_here(left - (0.0, 0.25, 0.0), WANTED, None, drops, ("left",)).quality < 1.0
