"""Intervals and tests that hold at any time: their error over many simulated studies, and their power."""

from __future__ import annotations

import math

import numpy as np
import pytest

from golem.evaluation.metrics.anytime import (
    anytime_interval,
    anytime_p,
    confidence_sequence,
    difference_interval,
    equal_within,
    log_capital,
    paired_evidence,
    unpaired_evidence,
)
from golem.types import Array

STUDIES, TRIALS = 2000, 200


def draws(rate: float, stream: int) -> Array:
    return (np.random.default_rng(stream).random((STUDIES, TRIALS)) < rate).astype(float)


@pytest.mark.parametrize("rate", [0.05, 0.5, 0.9])
def test_equal_methods_are_called_different_in_at_most_5_percent_at_any_time(rate: float) -> None:
    a, b = draws(rate, 1), draws(rate, 2)
    for evidence in (paired_evidence, unpaired_evidence):
        assert (anytime_p(evidence(a, b))[:, -1] <= 0.05).mean() <= 0.05


def test_equal_scores_are_called_different_in_at_most_5_percent_at_any_time() -> None:
    a, b = (np.random.default_rng(s).beta(2.0, 1.0, (STUDIES, TRIALS)) for s in (1, 2))
    assert (anytime_p(paired_evidence(a, b))[:, -1] <= 0.05).mean() <= 0.05


@pytest.mark.parametrize("rate", [0.02, 0.5, 0.97])
def test_the_true_mean_is_in_the_sequence_at_all_times_in_95_percent(rate: float) -> None:
    refuted = log_capital(draws(rate, 3), [rate])[..., 0].max(axis=-1) >= math.log(20.0)
    assert refuted.mean() <= 0.05


def test_a_margin_that_is_the_true_difference_is_refuted_in_at_most_5_percent() -> None:
    assert equal_within(draws(0.7, 4), draws(0.6, 5), 0.1)[:, -1].mean() <= 0.05


def test_far_beyond_a_margin_is_not_equal() -> None:
    assert not equal_within(draws(0.9, 4), draws(0.5, 5), 0.02).any()


def test_the_stakes_of_a_fixed_number_keep_their_coverage_too() -> None:
    values = np.random.default_rng(6).beta(0.3, 0.3, (STUDIES, 30))
    refuted = log_capital(values, [0.5], n=30)[..., 0].max(axis=-1) >= math.log(20.0)
    assert refuted.mean() <= 0.05


def test_twenty_points_are_found_long_before_a_hundred_trials() -> None:
    found = anytime_p(paired_evidence(draws(0.95, 7), draws(0.75, 8))) <= 0.05
    after = np.where(found.any(axis=1), found.argmax(axis=1) + 1, TRIALS)
    assert np.median(after) <= 60
    assert found[:, -1].mean() > 0.95


def test_a_sequence_never_widens_and_holds_the_grid_safely() -> None:
    low, high = confidence_sequence(draws(0.8, 9)[0])
    assert (np.diff(low) >= 0).all() and (np.diff(high) <= 0).all()
    assert low[-1] < 0.8 < high[-1]


def test_nothing_and_everything_have_a_width() -> None:
    assert anytime_interval([1.0] * 60).low < 0.95 and anytime_interval([1.0] * 60).high == 1.0
    assert anytime_interval([0.0] * 60).low == 0.0 and anytime_interval([0.0] * 60).high > 0.05
    two = anytime_interval([0.5, 0.5], n=2)
    assert two.low < 0.2 and two.high > 0.8
    both = difference_interval([1.0] * 10, [1.0] * 10)
    assert both.low < 0.0 < both.high


def test_pairs_that_do_not_differ_are_no_evidence() -> None:
    assert paired_evidence([1.0, 0.0, 1.0], [1.0, 0.0, 1.0]) == pytest.approx([0.0, 0.0, 0.0])
    # One pair of either kind: 2 B(1.5, 0.5) / B(0.5, 0.5) = 1, and both ways 4 B(1.5, 1.5) / B(0.5, 0.5) = 1 / 2.
    assert np.exp(paired_evidence([1.0, 0.0], [0.0, 1.0])) == pytest.approx([1.0, 0.5])
