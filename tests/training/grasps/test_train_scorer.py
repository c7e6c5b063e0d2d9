"""The scorer's training: slopes, the area under the curve, and that it learns; bad numbers are refused."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from golem.capabilities.grasping.hand_view import FACTS, SEEN
from golem.errors import ConfigError
from golem.training.grasps import train_scorer
from golem.training.grasps.grasp_labels import GraspLabels
from golem.training.grasps.train_scorer import TrainScorerConfig, auc, first_held, table, train, train_grasps


def made_up(seed: int, n: int = 600) -> GraspLabels:
    """Grasps that hold where the opening is small."""
    rng = np.random.default_rng(seed)
    facts = rng.uniform(0.0, 1.0, (n, FACTS)).astype(np.float32)
    return GraspLabels(rng.random((n, SEEN)) < 0.01, facts, facts[:, 0] < 0.4, np.arange(n) // 6, np.arange(n) % 4)


def test_area_under_the_curve_counts_ordered_pairs() -> None:
    scores, held = np.array([0.1, 0.4, 0.35, 0.8]), np.array([False, False, True, True])
    assert auc(scores, held) == 0.75
    assert auc(np.ones(4), held) == 0.5
    assert np.isnan(auc(scores, np.ones(4, bool)))


def test_slopes_are_those_of_the_loss() -> None:
    rng = np.random.default_rng(0)
    values: train_scorer.Pass = [rng.standard_normal(s).astype(np.float64) for s in ((6, 5), (5, 1), (5,), (1,))]
    x, held = rng.standard_normal((7, 6)), rng.random(7) < 0.5
    _, slopes = train_scorer._slopes(values, x, held, 0.0, rng)
    for value, slope in zip(values, slopes, strict=True):
        spot = np.unravel_index(int(np.abs(slope).argmax()), value.shape)
        losses = []
        for step in (1e-5, -2e-5):
            value[spot] += step
            losses.append(train_scorer._slopes(values, x, held, 0.0, rng)[0])
        value[spot] += 1e-5
        assert slope[spot] == pytest.approx((losses[0] - losses[1]) / 2e-5, rel=1e-3)


def test_it_learns_and_is_the_same_again(tmp_path: Path) -> None:
    data, held = made_up(0), made_up(1)
    nets = [
        train(data, held, TrainScorerConfig(epochs=8, batch=8, rate=3e-3), tmp_path / "curve.csv") for _ in range(2)
    ]
    scores = nets[0].logits(held.cells, held.facts)
    assert auc(scores, held.held) > 0.8
    assert first_held(scores, held) > 0.8
    np.testing.assert_array_equal(scores, nets[1].logits(held.cells, held.facts))
    with (tmp_path / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["epoch"] for row in rows] == [str(k) for k in range(1, 9)]
    assert "| all | 600 |" in table(held, scores)


def test_bad_numbers_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="must be 1 or more"):
        train_grasps(out=tmp_path, wares=0)
