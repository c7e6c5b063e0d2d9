"""The scorer: antipodal grasps in the order of a network, and what files of weights are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.grasping.antipodal import Antipodal
from golem.capabilities.grasping.base import Grasp, Gripper
from golem.capabilities.grasping.hand_view import FACTS, SEEN, hand_view, mirrored
from golem.capabilities.grasping.scorer import GraspNet, Scorer, ScorerConfig, load_net
from golem.errors import ConfigError

from . import things


def by_fact(fact: int, slope: float) -> GraspNet:
    """A network of one layer that looks at one of the facts alone."""
    weight = np.zeros((SEEN + FACTS, 1), np.float32)
    weight[SEEN + fact] = slope
    return GraspNet((weight,), (np.zeros(1, np.float32),))


def from_above() -> Gripper:
    return Gripper("right", np.eye(4), -np.pi / 2)


def test_the_networks_order_is_that_of_the_proposals(tmp_path: Path) -> None:
    by_fact(0, -4.0).save(tmp_path / "narrow.npz")
    scorer = Scorer(ScorerConfig(weights=str(tmp_path / "narrow.npz")))
    can = things.can()
    grasps = scorer.propose(can, can.points, from_above())
    assert len(grasps) == len(Antipodal().propose(can, can.points, from_above())) > 3
    assert [g.gap for g in grasps] == sorted(g.gap for g in grasps)
    assert all(0.0 < g.score < 0.5 for g in grasps)


def test_what_hardly_holds_is_left_out(tmp_path: Path) -> None:
    by_fact(0, -4.0).save(tmp_path / "narrow.npz")
    scorer = Scorer(ScorerConfig(weights=str(tmp_path / "narrow.npz"), least=0.9))
    can = things.can()
    assert scorer.propose(can, can.points, from_above()) == []


def test_a_mirrored_hand_sees_the_mirrored_cloud() -> None:
    rng = np.random.default_rng(0)
    cloud = rng.uniform(-0.05, 0.05, (400, 3)) + (0.004, 0.003, 0.0)
    grasp = [Grasp(np.eye(4), 0.06, 0.7)]
    for axis in (0, 1):
        flipped = cloud * np.where(np.arange(3) == axis, -1.0, 1.0)
        cells, facts = mirrored(*hand_view(grasp, cloud), axis)
        seen, numbers = hand_view(grasp, flipped)
        assert (cells != seen).mean() < 0.001  # but for points on a cell's edge
        np.testing.assert_allclose(facts, numbers, atol=1e-5)


def test_the_shipped_network_prefers_the_middle_of_a_can() -> None:
    can = things.can()
    grasps = Scorer().propose(can, can.points, from_above())
    T = grasps[0].T_odom_gripper
    off = abs((things.CAN - T[:3, 3])[:2] @ T[:2, 1])
    assert grasps[0].score > 0.5 and off < 0.01


def test_bad_weights_are_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.npz cannot be read: No such file"):
        load_net(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no archive")
    with pytest.raises(ConfigError, match="holds no grasp scorer; `golem train grasps`"):
        load_net(tmp_path / "text.npz")
    np.savez(tmp_path / "other.npz", kind="something else")
    with pytest.raises(ConfigError, match="holds no grasp scorer"):
        load_net(tmp_path / "other.npz")
    GraspNet((np.zeros((5, 1), np.float32),), (np.zeros(1, np.float32),)).save(tmp_path / "small.npz")
    with pytest.raises(ConfigError, match="another architecture"):
        Scorer(ScorerConfig(weights=str(tmp_path / "small.npz")))
