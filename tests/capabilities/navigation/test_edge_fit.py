"""The near edge of a pack, from points on its rim with noise and other things beside it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from golem.capabilities.navigation.edge_fit import NearEdge, near_edge
from golem.types import PlanarPose

VIEW = PlanarPose(2.0, 1.0, 0.5)


def pack(pose: PlanarPose, rng: np.random.Generator, count: int = 3000) -> np.ndarray:
    """Return points of a pack's top, 1.2 m deep and 2 m wide, whose near edge is at `pose` seen from `VIEW`."""
    local = rng.uniform((0.0, -1.0), (1.2, 1.0), (count, 2))
    local[: count // 3, 0] = 0.0  # its front
    local += 0.01 * rng.standard_normal(local.shape)
    T = VIEW @ pose
    c, s = math.cos(T.yaw), math.sin(T.yaw)
    return local @ np.array([[c, s], [-s, c]]) + (T.x, T.y)


@pytest.mark.parametrize("pose", [PlanarPose(0.9, 0.1, 0.0), PlanarPose(0.7, -0.2, 0.3), PlanarPose(1.2, 0.0, -0.4)])
def test_the_edge_is_where_the_pack_is(pose: PlanarPose) -> None:
    rng = np.random.default_rng(1)
    edge = near_edge(pack(pose, rng), VIEW)
    assert isinstance(edge, NearEdge)
    off = (VIEW @ pose).to(edge.pose)
    assert abs(off.x) < 0.02 and abs(off.y) < 0.06 and abs(off.yaw) < 0.02
    assert edge.length == pytest.approx(2.0, abs=0.15)


def test_a_pillar_beside_the_pack_does_not_matter() -> None:
    rng = np.random.default_rng(2)
    pose = PlanarPose(1.0, 0.0, 0.1)
    pillar = np.array([VIEW.x, VIEW.y]) + rng.uniform(0.4, 0.5, (200, 2))
    edge = near_edge(np.concatenate([pack(pose, rng), pillar]), VIEW)
    assert isinstance(edge, NearEdge) and abs((VIEW @ pose).to(edge.pose).yaw) < 0.03


def test_nothing_and_noise_are_no_edge() -> None:
    assert "Nothing" in str(near_edge(np.zeros((0, 2)), VIEW))
    assert "Nothing" in str(near_edge(np.full((50, 2), np.nan), VIEW))
    rng = np.random.default_rng(3)
    noise = rng.uniform(-1.0, 1.0, (4000, 2)) * (0.2, 1.0) + (0.5, 0.0)
    wild = noise + np.column_stack([0.8 * np.sin(25.0 * noise[:, 1]), np.zeros(4000)]) + (1.0, 0.0)
    found = near_edge(wild, PlanarPose(0.0, 0.0, 0.0), 4.0)
    assert isinstance(found, str) or found.slices < 20


def test_what_stands_in_a_row_on_a_counter_is_not_its_edge() -> None:
    # From close by belly and arms hide most of the rim, and a line through the things behind it has more points.
    rim = np.concatenate([np.arange(-0.66, -0.3, 0.01), np.arange(0.46, 0.6, 0.01)])
    row = np.concatenate([np.arange(-0.3, 0.46, 0.01), np.arange(0.6, 1.2, 0.01)])
    places = [np.column_stack([np.full_like(rim, 0.37), rim]), np.column_stack([0.5 + 0.1 * row, row])]
    edge = near_edge(np.concatenate(places), PlanarPose(0.0, 0.0, 0.0))
    assert isinstance(edge, NearEdge) and abs(edge.pose.x - 0.37) < 0.01 and abs(edge.pose.yaw) < 0.02
