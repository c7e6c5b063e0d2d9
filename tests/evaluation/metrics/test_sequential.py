"""Comparisons of cells: scene by scene where the seeds are the same, rate against rate where they are not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from golem.evaluation.metrics.anytime import anytime_p, paired_evidence, unpaired_evidence
from golem.evaluation.metrics.sequential import Pair, StopRule, decisions, pair_of, sequential_tables
from golem.types import Array


def records(successes: Array, seed: int) -> dict[int, Any]:
    return {i: [SimpleNamespace(index=i, seed=seed, success=bool(s), series={})] for i, s in enumerate(successes)}


@pytest.fixture
def sides() -> tuple[Array, Array]:
    """Successes of two methods that win and lose the same scenes but for one in ten."""
    scenes = np.arange(200) % 2 == 0
    better = scenes | (np.arange(200) % 10 == 1)
    return better.astype(float), scenes.astype(float)


def compared(a: Array, b: Array, seeds: tuple[int, int]) -> Pair:
    pair = pair_of("a", records(a, seeds[0]), "b", records(b, seeds[1]), StopRule())
    assert pair is not None
    return pair


def test_the_same_seed_is_compared_scene_by_scene_and_another_by_its_rates(sides: tuple[Array, Array]) -> None:
    same, others = (compared(*sides, seeds) for seeds in ((1, 1), (1, 2)))
    assert same[4] and not others[4]
    (paired,), (unpaired,) = decisions([same], StopRule()), decisions([others], StopRule())
    assert paired.p == anytime_p(paired_evidence(*sides))[-1] < 0.01  # 20 scenes won, none lost
    assert unpaired.p == anytime_p(unpaired_evidence(*sides))[-1] > 0.05  # 60 % against 50 %
    assert paired.after is not None and unpaired.after is None


def test_scores_are_compared_by_their_mean_difference() -> None:
    rng = np.random.default_rng(0)
    a, b = 0.5 + 0.4 * rng.random((2, 100))
    (found,) = decisions([("a", "b", a, b - 0.4, False)], StopRule())
    assert found.p < 0.01


def test_what_has_no_trial_in_common_is_no_pair() -> None:
    assert pair_of("a", records(np.ones(3), 1), "b", {}, StopRule()) is None


@pytest.mark.parametrize("margin", [0.05, 0.1, 0.15, 0.2])
def test_what_ends_as_equal_is_called_equal(margin: float) -> None:
    """The run ends with the trial that refutes the last of both margins: the interval then ends just there."""
    rule, rng = StopRule(margin), np.random.default_rng(0)
    for _ in range(20):
        a, b = (rng.random((2, 3000)) < 0.95).astype(float)
        ended = rule.decided_after(a, b)
        assert ended is not None
        found = decisions([("a", "b", a[:ended], b[:ended], True)], rule)
        verdict = sequential_tables({}, found, rule)[-1].rows[0][-1]
        assert verdict.endswith(f"{'is better' if found[0].p <= 0.05 else 'equal'}, known after {ended}")
