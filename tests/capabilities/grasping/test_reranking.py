"""Reranked grasps: first those the arm reaches, by what holds and suits it, and none is lost, whoever proposes."""

from __future__ import annotations

import numpy as np
import pytest

from golem import registry
from golem.capabilities.arms.postures import POSTURES
from golem.capabilities.arms.quick_ik import QuickIK
from golem.capabilities.grasping.base import Grasp, Gripper
from golem.capabilities.grasping.reranking import ProposerChoice, Reranking, RerankingConfig
from golem.errors import ConfigError

from . import things

AHEAD = np.array([1.0, 0.0, 0.0])


def hand(approach: np.ndarray = AHEAD) -> Gripper:
    return Gripper("right", np.eye(4), -np.pi / 2, approach, POSTURES["forward"])


def reached(grasps: list[Grasp]) -> list[Grasp]:
    """Return the grasps that are said to be reached and free."""
    return [grasp for grasp in grasps if grasp.score > 1.0]


def poses(grasps: list[Grasp]) -> list[bytes]:
    return [grasp.T_odom_gripper.tobytes() for grasp in grasps]


def test_every_grasp_is_the_proposers_and_the_first_are_reached() -> None:
    bar = things.bar()
    plain = registry.create("grasp_method", "antipodal", {}).propose(bar, bar.points, hand())
    ranked = Reranking(RerankingConfig(most=20)).propose(bar, bar.points, hand())
    assert sorted(poses(ranked)) == sorted(poses(plain))
    scores = [grasp.score for grasp in ranked]
    assert scores == sorted(scores, reverse=True)
    ik, rng = QuickIK(), np.random.default_rng(0)
    starts = POSTURES["forward"] + 0.3 * rng.standard_normal((30, 15)) * (np.arange(15) >= 8)
    first = reached(ranked)
    assert 1 <= len(first) <= 20
    assert all(ik.solve("right", grasp.T_odom_gripper, starts) is not None for grasp in first)


def test_comfort_decides_only_between_grasps_that_hold_about_as_well() -> None:
    bar = things.bar()
    plain = registry.create("grasp_method", "antipodal", {}).propose(bar, bar.points, hand())
    worth = {grasp.T_odom_gripper.tobytes(): grasp.score for grasp in plain}
    by_score = Reranking(RerankingConfig(comfort=0.0)).propose(bar, bar.points, hand())
    kept = [worth[pose] for pose in poses(reached(by_score))]
    assert kept == sorted(kept, reverse=True)
    ranked = [worth[pose] for pose in poses(reached(Reranking().propose(bar, bar.points, hand())))]
    assert ranked[0] >= (1.0 - RerankingConfig().comfort) * kept[0]


def test_what_is_out_of_reach_stays_in_the_proposers_order() -> None:
    bar = things.bar()
    away = things.seen(bar.points + (1.0, 0.0, 0.0), bar.position + (1.0, 0.0, 0.0))
    plain = registry.create("grasp_method", "antipodal", {}).propose(away, away.points, hand())
    ranked = Reranking().propose(away, away.points, hand())
    assert poses(ranked) == poses(plain)
    assert reached(ranked) == []


def test_what_the_arm_alone_does_not_reach_is_reached_with_the_torso_turned() -> None:
    bar, by = things.bar(), np.array([0.15, 0.3, 0.0])
    across = things.seen(bar.points + by, bar.position + by)
    found = reached(Reranking().propose(across, across.points, hand()))
    assert len(found) >= 3
    ik, ahead = QuickIK(), POSTURES["forward"]
    assert all(ik.approach("right", grasp.T_odom_gripper, 0.12, ahead[None]) is None for grasp in found)


def test_a_wall_before_the_object_leaves_nothing() -> None:
    bar = things.bar()
    y, z = np.meshgrid(np.linspace(-0.7, 0.2, 120), np.linspace(-0.3, 0.8, 120))
    wall = np.column_stack([np.full(y.size, 0.38), y.ravel(), z.ravel()])
    scene = np.concatenate([bar.points, np.repeat(wall, 4, axis=0)])
    home = Gripper("right", np.eye(4), -np.pi / 2, AHEAD, POSTURES["home"])
    assert reached(Reranking().propose(bar, bar.points, home)) != []
    assert reached(Reranking().propose(bar, scene, home)) == []


def test_any_method_can_propose_and_its_law_is_kept() -> None:
    method = Reranking(RerankingConfig(ProposerChoice("visual_servo")))
    bar = things.bar()
    grasps = method.propose(bar, np.zeros((0, 3)), hand(np.array([0.0, 0.0, -1.0])))
    assert method.latency > registry.create("grasp_method", "visual_servo", {}).latency
    assert len(grasps) == 1
    assert method.servo(bar, grasps[0], 0.0) is not None


def test_a_proposer_that_ranks_itself_or_does_not_exist_is_refused() -> None:
    with pytest.raises(ConfigError, match="another proposer"):
        Reranking(RerankingConfig(ProposerChoice("reranked")))
    with pytest.raises(ConfigError, match="antipodal"):
        Reranking(RerankingConfig(ProposerChoice("antipodel")))
