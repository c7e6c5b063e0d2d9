from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from golem.capabilities.legs.mpc.controller import Planner, PlannerConfig
from golem.errors import ConfigError
from golem.types import Array

LOWER, UPPER = np.full(12, -1.0), np.full(12, 1.0)
GOAL = np.linspace(-0.3, 0.3, 12)


def planner(config: PlannerConfig) -> Planner:
    return Planner(config, 1.0, LOWER, UPPER)


def distance(knots: Array) -> Array:
    return ((knots - GOAL) ** 2).mean(axis=(1, 2))


@pytest.mark.parametrize("method", ["cem", "predictive_sampling"])
def test_plans_become_cheaper(method: str) -> None:
    tried = planner(PlannerConfig(method=method, samples=64))  # pyright: ignore[reportArgumentType]
    costs = []
    for _ in range(40):
        knots = tried.sample()
        assert (knots >= LOWER).all() and (knots <= UPPER).all()
        costs.append(distance(knots)[0])
        tried.update(knots, distance(knots))
    assert costs[-1] < 0.8 * costs[0]


def test_predictive_sampling_never_gets_worse_and_takes_the_best() -> None:
    tried = planner(PlannerConfig(method="predictive_sampling"))
    knots = tried.sample()
    costs = distance(knots)
    tried.update(knots, costs)
    np.testing.assert_array_equal(tried.sample()[0], knots[np.argmin(costs)])
    assert costs.min() <= costs[0]


@pytest.mark.parametrize(("present", "gain"), [(3.0, 1.0), (1.5, 0.4)])
def test_cem_moves_to_the_mean_of_the_elite_but_slowly_while_the_plan_is_good(present: float, gain: float) -> None:
    tried = planner(PlannerConfig(samples=8, elite=0.25, gain=0.4))
    knots = tried.sample()
    tried.update(knots, np.full(8, np.nan))
    np.testing.assert_array_equal(tried.sample()[0], knots[0])
    tried.update(knots, np.array([present, np.nan, 1.0, 5.0, np.inf, 2.0, 9.0, 9.0]))
    elite = [2, 5] if gain == 1.0 else [2, 0]
    np.testing.assert_allclose(tried.sample()[0], gain * knots[elite].mean(axis=0) + (1.0 - gain) * knots[0])


def test_cem_averages_nothing_that_diverged() -> None:
    tried = planner(PlannerConfig(samples=8, elite=0.5))
    knots = tried.sample()
    assert tried.update(knots, np.array([np.nan, np.inf, 1.0, np.nan, np.nan, 2.0, np.nan, np.nan]))
    np.testing.assert_allclose(tried.sample()[0], knots[[2, 5]].mean(axis=0))
    assert not tried.update(knots, np.full(8, np.inf))


def test_some_samples_keep_the_full_noise() -> None:
    tried = planner(PlannerConfig(samples=201, narrowest=0.1, wide=0.5))
    for _ in range(20):
        knots = tried.sample()
        tried.update(knots, distance(knots))
    spread = tried.sample()[1:] - tried.sample()[0]
    assert spread[:100].std() > 1.3 * spread[100:].std()


def test_a_shifted_plan_has_the_same_targets_earlier() -> None:
    tried = planner(PlannerConfig(knots=5))
    knots = tried.sample()
    tried.update(knots, distance(knots))
    ahead = tried.targets(np.array([0.25, 0.5, 1.0, 3.0]))
    np.testing.assert_array_equal(ahead[2], ahead[3])
    tried.shift(0.25)
    np.testing.assert_allclose(tried.targets(np.array([0.0, 0.25, 0.75])), ahead[:3], atol=1e-12)


def test_noise_narrows_to_the_elite_and_returns_with_a_reset() -> None:
    config = PlannerConfig(samples=32, narrowest=0.1, wide=0.0)
    tried = planner(config)
    first = tried.sample()
    for _ in range(20):
        knots = tried.sample()
        tried.update(knots, distance(knots))
    assert tried.sample()[1:].std(axis=0).mean() < 0.7 * first[1:].std(axis=0).mean()
    tried.reset(np.zeros(12))
    np.testing.assert_array_equal(tried.sample(), first)
    other = planner(replace(config, seed=1))
    assert not np.array_equal(other.sample(), first)


@pytest.mark.parametrize(
    ("wrong", "word"),
    [
        (PlannerConfig(samples=1), "two samples"),
        (PlannerConfig(elite=0.0), "elite"),
        (PlannerConfig(noise=(0.1,)), "six"),
    ],
)
def test_wrong_options_are_named(wrong: PlannerConfig, word: str) -> None:
    with pytest.raises(ConfigError, match=word):
        planner(wrong)
