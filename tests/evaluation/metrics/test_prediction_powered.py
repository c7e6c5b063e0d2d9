from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.metrics.prediction_powered import prediction_powered
from golem.evaluation.metrics.statistics import wilson


def draw(rng: np.random.Generator, n: int, rate: float, like: float) -> tuple[list[float], list[float], list[float]]:
    """Real outcomes, the twin's of the same, which agree with probability `like`, and 400 more of the twin's."""
    real = rng.random(n) < rate
    other = rng.random(n) < rate
    paired = np.where(rng.random(n) < like, real, other)
    return real.astype(float).tolist(), paired.astype(float).tolist(), (rng.random(400) < rate).astype(float).tolist()


@pytest.mark.parametrize("like", [0.0, 0.5, 0.9])
def test_it_covers_the_truth_and_is_never_wider_than_the_real_trials_alone(like: float) -> None:
    rng, hits, widths, alone = np.random.default_rng(1), 0, list[float](), list[float]()
    for _ in range(400):
        found = prediction_powered(*draw(rng, 40, 0.7, like))
        hits += found.interval.low <= 0.7 <= found.interval.high
        widths.append(found.interval.high - found.interval.low)
        alone.append(found.real.high - found.real.low)
        assert widths[-1] <= alone[-1] + 1e-12
    assert hits >= 0.925 * 400
    if like == 0.9:
        assert np.median(widths) < 0.6 * np.median(alone)


def test_a_twin_that_says_nothing_leaves_the_real_interval() -> None:
    real = [1.0] * 25 + [0.0] * 5
    plain = wilson(25, 30)
    for paired, others in (([1.0] * 30, [1.0] * 100), (real[::-1], [1.0, 0.0] * 50), (real, [1.0, 0.0])):
        found = prediction_powered(real, paired, others)
        assert found.interval == plain and found.worth == 30 and found.weight == 0.0
    # All real trials alike: nothing to correlate with.
    assert prediction_powered([1.0] * 30, real, [1.0, 0.0] * 50).interval == wilson(30, 30)


def test_a_twin_that_agrees_in_all_is_worth_all_its_trials() -> None:
    real = [1.0, 0.0] * 15
    found = prediction_powered(real, real, [1.0, 0.0] * 200)
    assert found.worth > 300 and found.interval.high - found.interval.low < 0.12


def test_a_biased_twin_is_corrected() -> None:
    rng = np.random.default_rng(2)
    rates = []
    for _ in range(200):
        real = rng.random(60) < 0.5
        paired = (real | (rng.random(60) < 0.4)).astype(float)  # promises 0.7
        others = (rng.random(400) < 0.7).astype(float)
        rates.append(prediction_powered(real.astype(float).tolist(), paired.tolist(), others.tolist()).rate)
    assert np.mean(rates) == pytest.approx(0.5, abs=0.01)
