"""Hands lean with the wall below a rim, and a little further; upright walls get an upright hand."""

from __future__ import annotations

import numpy as np
import pytest

from golem.capabilities.grasping.antipodal import Antipodal
from golem.capabilities.grasping.base import Gripper
from golem.capabilities.grasping.rims import FURTHER, MOST, rim_pairs, wall_lean
from golem.types import Array

from . import things

DOWN = np.array([0.0, 0.0, -1.0])
RIM, RADIUS, MIDDLE = 0.06, 0.08, np.array([0.45, -0.15])


def hollow(lean: float) -> Array:
    """Return a round thing whose wall leans outwards by `lean` [rad], as a noisy camera above it shows it."""
    rng = np.random.default_rng(0)
    turn, down = rng.uniform(-np.pi, np.pi, 3000), rng.uniform(0.0, 0.045, 3000)
    # An upright wall shows its rim and nothing below it.
    down = down if lean > 0.05 else np.minimum(down, 0.004)
    radius = RADIUS - np.tan(lean) * down - rng.uniform(0.0, 0.004, 3000) * (down < 0.004)
    wall = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), RIM - down])
    spread, around = 0.04 * np.sqrt(rng.random(800)), rng.uniform(-np.pi, np.pi, 800)
    bottom = np.column_stack([spread * np.cos(around), spread * np.sin(around), np.full(800, 0.01)])
    cloud = np.concatenate([wall, bottom]) + rng.normal(0.0, 0.0007, (3800, 3))
    return cloud + (*MIDDLE, 0.0)


@pytest.mark.parametrize("lean", [0.0, 0.25, 0.32])
def test_a_pair_leans_a_little_further_than_its_wall(lean: float) -> None:
    middles, axes, widths, quality = rim_pairs(hollow(lean), DOWN)
    assert 15 < len(middles) == len(axes) == len(widths) == len(quality)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0)
    outward = (middles[:, :2] - MIDDLE) / np.linalg.norm(middles[:, :2] - MIDDLE, axis=1)[:, None]
    across = np.einsum("ij,ij->i", axes[:, :2], outward)
    leans = np.arctan2(-axes[:, 2], across)
    best = np.median(leans[quality == quality.max()])
    np.testing.assert_allclose(best, min(lean + FURTHER, MOST) if lean else 0.0, atol=0.07)


def test_the_rounded_edge_of_an_upright_wall_does_not_lean() -> None:
    rng = np.random.default_rng(0)
    outward = np.array([1.0, 0.0, 0.0])

    def wall(high: float) -> Array:
        """Return a wall that leans by 0.3 rad, as far as `high` [m] below its rim it is seen."""
        down, aside = rng.uniform(0.003, high, 60), rng.uniform(-0.009, 0.009, 60)
        return np.column_stack([-np.tan(0.3) * down, aside, -down])

    assert wall_lean(wall(0.007), outward, DOWN, 0.0) == 0.0
    assert wall_lean(wall(0.025), outward, DOWN, 0.0) == pytest.approx(0.3, abs=0.02)


def test_the_hand_on_a_bowl_points_under_its_middle_and_stays_off_its_bottom() -> None:
    cloud = hollow(0.32)
    table = np.column_stack([np.random.default_rng(1).uniform(-0.2, 0.2, (6000, 2)) + MIDDLE, np.zeros(6000)])
    thing = things.seen(cloud, cloud[0])
    grasps = Antipodal().propose(thing, np.concatenate([cloud, table]), Gripper("right", np.eye(4), -1.57))
    assert len(grasps) >= 8
    for grasp in grasps[:8]:
        T = grasp.T_odom_gripper
        inward = MIDDLE - T[:2, 3]
        assert T[:2, 2] @ inward > 0.25 * np.linalg.norm(inward)
        assert 0.015 < T[2, 3] < RIM - 0.015
