"""Reranked grasps: only those the arm reaches, in the order of what suits it, whoever proposes."""

from __future__ import annotations

import numpy as np
import pytest

from golem import registry
from golem.capabilities.arms.arm_kinematics import UpperKinematics
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.quick_ik import QuickIK
from golem.capabilities.grasping.base import Gripper
from golem.capabilities.grasping.reranking import ProposerChoice, Reranking, RerankingConfig
from golem.errors import ConfigError

from . import things

AHEAD = np.array([1.0, 0.0, 0.0])


def hand(approach: np.ndarray = AHEAD) -> Gripper:
    return Gripper("right", np.eye(4), -np.pi / 2, approach, POSTURES["forward"])


def test_quick_ik_finds_what_the_arm_reaches_and_nothing_else() -> None:
    ik, kinematics = QuickIK(), UpperKinematics()
    rng = np.random.default_rng(0)
    found = 0
    for _ in range(20):
        q = POSTURES["forward"].copy()
        q[8:] += 0.3 * rng.standard_normal(7)
        q = np.clip(q, kinematics.lower + 0.01, kinematics.upper - 0.01)
        T = kinematics.pose("right", q)
        solved = ik.solve("right", T, POSTURES["forward"][None])
        if solved is not None:
            found += 1
            np.testing.assert_allclose(kinematics.pose("right", solved)[:3, 3], T[:3, 3], atol=1.1e-3)
            assert ((solved >= kinematics.lower) & (solved <= kinematics.upper)).all()
            np.testing.assert_array_equal(solved[:8], POSTURES["forward"][:8])
    assert found >= 18
    far = np.eye(4)
    far[:3, 3] = 2.0, 0.0, 0.0
    assert ik.solve("right", far, POSTURES["forward"][None]) is None


def test_what_it_returns_is_reached_and_every_grasp_is_the_proposers() -> None:
    bar = things.bar()
    method = Reranking()
    plain = registry.create("grasp_method", "antipodal", {}).propose(bar, bar.points, hand())
    ranked = method.propose(bar, bar.points, hand())
    assert 1 <= len(ranked) <= len(plain)
    scores = [grasp.score for grasp in ranked]
    assert scores == sorted(scores, reverse=True)
    poses = [grasp.T_odom_gripper.tobytes() for grasp in plain]
    ik, rng = QuickIK(), np.random.default_rng(0)
    starts = POSTURES["forward"] + 0.3 * rng.standard_normal((30, 15)) * (np.arange(15) >= 8)
    for grasp in ranked:
        assert grasp.T_odom_gripper.tobytes() in poses
        assert ik.solve("right", grasp.T_odom_gripper, starts) is not None


def test_what_is_out_of_reach_is_left_out() -> None:
    bar = things.bar()
    away = things.seen(bar.points + (1.0, 0.0, 0.0), bar.position + (1.0, 0.0, 0.0))
    assert Reranking().propose(away, away.points, hand()) == []


def test_a_wall_before_the_object_leaves_nothing() -> None:
    bar = things.bar()
    y, z = np.meshgrid(np.linspace(-0.7, 0.2, 120), np.linspace(-0.3, 0.8, 120))
    wall = np.column_stack([np.full(y.size, 0.38), y.ravel(), z.ravel()])
    scene = np.concatenate([bar.points, np.repeat(wall, 4, axis=0)])
    home = Gripper("right", np.eye(4), -np.pi / 2, AHEAD, POSTURES["home"])
    assert Reranking().propose(bar, bar.points, home) != []
    assert Reranking().propose(bar, scene, home) == []


def test_any_method_can_propose_and_its_law_is_kept() -> None:
    method = Reranking(RerankingConfig(ProposerChoice("visual_servo")))
    bar = things.bar()
    grasps = method.propose(bar, np.zeros((0, 3)), hand(np.array([0.0, 0.0, -1.0])))
    assert method.latency > registry.create("grasp_method", "visual_servo", {}).latency
    assert len(grasps) <= 1
    grasp = (
        grasps[0]
        if grasps
        else registry.create("grasp_method", "centroid", {}).propose(bar, np.zeros((0, 3)), hand())[0]
    )
    assert method.servo(bar, grasp, 0.0) is not None


def test_a_proposer_that_ranks_itself_or_does_not_exist_is_refused() -> None:
    with pytest.raises(ConfigError, match="another proposer"):
        Reranking(RerankingConfig(ProposerChoice("reranked")))
    with pytest.raises(ConfigError, match="antipodal"):
        Reranking(RerankingConfig(ProposerChoice("antipodel")))
