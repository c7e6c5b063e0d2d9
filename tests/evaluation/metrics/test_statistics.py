from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import binom, binomtest, norm

from golem.evaluation.metrics.statistics import (
    Interval,
    PairedTable,
    clustered,
    distribution,
    holm,
    mcnemar,
    mean_interval,
    paired_difference,
    wilson,
)


@pytest.mark.parametrize(
    ("successes", "n", "low", "high"),
    [
        (30, 30, 88.6, 100),
        (29, 30, 83.3, 99.4),
        (27, 30, 74.4, 96.5),
        (26, 30, 70.3, 94.7),
        (24, 30, 62.7, 90.5),
        (21, 30, 52.1, 83.3),
        (19, 30, 45.5, 78.1),
        (16, 30, 36.1, 69.8),
        (11, 30, 21.9, 54.5),
        (8, 30, 14.2, 44.4),
        (0, 30, 0, 11.4),
        (19, 20, 76.4, 99.1),
        (14, 15, 70.2, 98.8),
    ],
)
def test_wilson_reproduces_the_papers_intervals(successes: int, n: int, low: float, high: float) -> None:
    interval = wilson(successes, n)
    assert round(100 * interval.low, 1) == low
    assert round(100 * interval.high, 1) == high


@given(st.integers(1, 300).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_bounds_solve_the_score_equation(counts: tuple[int, int]) -> None:
    successes, n = counts
    z, rate = norm.ppf(0.975), successes / n
    interval = wilson(successes, n)
    for bound in (interval.low, interval.high):
        assert n * (rate - bound) ** 2 == pytest.approx(z * z * bound * (1 - bound), abs=1e-9)


@pytest.mark.parametrize(
    ("only_a", "only_b", "p"),
    [(0, 0, 1.0), (5, 0, 0.0625), (6, 0, 0.03125), (0, 6, 0.03125), (3, 3, 1.0), (1, 9, 22 / 1024)],
)
def test_mcnemar_is_the_exact_sign_test_of_discordant_pairs(only_a: int, only_b: int, p: float) -> None:
    assert mcnemar(PairedTable(17, only_a, only_b, 4)) == pytest.approx(p)


def test_paired_table_counts_each_cell() -> None:
    a = [True, True, True, False, False, False, True]
    b = [True, False, True, True, False, False, False]
    assert PairedTable.count(a, b) == PairedTable(both=2, only_a=2, only_b=1, neither=2)


def test_paired_table_refuses_unequal_numbers_of_trials() -> None:
    with pytest.raises(ValueError):
        PairedTable.count([True], [True, False])


def test_paired_difference_reproduces_newcombes_example() -> None:
    # Newcombe 1998 (Stat Med 17:2635), table II: a, b, c, d = 36, 12, 2, 0; method 10.
    interval = paired_difference(PairedTable(36, 12, 2, 0))
    assert (round(interval.low, 4), round(interval.high, 4)) == (0.0569, 0.3404)


@given(st.tuples(*[st.integers(0, 40)] * 4).filter(lambda cells: sum(cells) > 0))
def test_paired_difference_holds_the_estimate_and_mirrors(cells: tuple[int, int, int, int]) -> None:
    table = PairedTable(*cells)
    mirrored = paired_difference(PairedTable(table.both, table.only_b, table.only_a, table.neither))
    interval = paired_difference(table)
    estimate = (table.only_a - table.only_b) / table.n
    assert -1 - 1e-12 <= interval.low <= estimate + 1e-12
    assert estimate - 1e-12 <= interval.high <= 1 + 1e-12
    assert (interval.low, interval.high) == pytest.approx((-mirrored.high, -mirrored.low))


def test_paired_difference_covers_the_truth_about_as_often_as_it_says() -> None:
    n, truth = 20, np.array((0.5, 0.3, 0.05, 0.15))
    covered = 0.0
    for both, only_a, only_b in itertools.product(range(n + 1), repeat=3):
        neither = n - both - only_a - only_b
        if neither < 0:
            continue
        cells = (both, only_a, only_b, neither)
        ways = math.factorial(n) / math.prod(map(math.factorial, cells))
        interval = paired_difference(PairedTable(*cells))
        if interval.low <= 0.25 <= interval.high:
            covered += ways * float(np.prod(truth**cells))
    assert 0.94 < covered < 0.98


def test_holm_steps_down_and_keeps_the_order() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_what_is_quoted_of_values() -> None:
    found = distribution([40.0, 10.0, -30.0, 20.0, 50.0])
    assert found is not None
    assert (found.n, found.q1, found.median, found.q3) == (5, 10.0, 20.0, 40.0)
    assert (found.minimum, found.maximum, found.mean) == (-30.0, 50.0, pytest.approx(18.0))
    assert found.rms == pytest.approx(math.sqrt(55.0 / 5) * 10.0)
    assert found.median_interval is None, "five values bound no median with 95 %"
    assert distribution([]) is None


def test_the_interval_of_a_mean_is_students() -> None:
    # Student 1908 (Biometrika 6:1), hours of sleep gained with the first drug: mean 0.75, 95 % interval -0.53 to 2.03.
    gained = [0.7, -1.6, -0.2, -1.2, -0.1, 3.4, 3.7, 0.8, 0.0, 2.0]
    found = mean_interval(gained)
    assert found is not None
    assert (round(found.low, 2), round(found.high, 2)) == (-0.53, 2.03)
    assert mean_interval([1.0]) is None


def test_the_interval_of_a_mean_is_cut_at_what_can_be() -> None:
    forces = [0.0, 0.0, 70.0]
    free, cut = mean_interval(forces), mean_interval(forces, 0.0)
    assert free is not None and cut is not None
    assert free.low < -70.0 and (cut.low, cut.high) == (0.0, free.high)


def test_a_share_of_yes_and_no_has_wilsons_interval() -> None:
    assert mean_interval([1.0, 1.0], 0.0, 1.0) == wilson(2, 2)
    assert mean_interval([1.0, 0.0, 1.0], 0.0, 1.0) == wilson(2, 3)


def test_the_mean_of_shares_is_quoted_with_an_interval_that_holds_it() -> None:
    rng, held = np.random.default_rng(0), 0
    for _ in range(100):
        found = distribution(rng.beta(2.0, 3.0, 64).round(2).tolist(), 0.0, 1.0)
        assert found is not None and found.mean_interval is not None
        assert found.mean_interval.low <= found.mean <= found.mean_interval.high
        assert found.mean_interval.high - found.mean_interval.low < 0.2
        held += found.mean_interval.low <= 0.4 <= found.mean_interval.high
    assert held >= 94


def test_other_shares_have_an_interval_that_assumes_no_distribution() -> None:
    assert mean_interval([0.5, 0.5], 0.0, 1.0) == Interval(0.0, 1.0), "two values say nothing"
    found = mean_interval([0.5, 1.0, 1.0, 0.9] * 10, 0.0, 1.0)
    assert found is not None and 0.6 < found.low < 0.85 < found.high < 1.0
    apart = mean_interval([0.5, 0.4, 0.6, 0.5] * 10, -1.0, 1.0)
    assert apart is not None and 0.0 < apart.low < 0.5 < apart.high < 1.0


@pytest.mark.parametrize("n, k", [(30, 27), (300, 300), (10, 0), (54, 42)])
def test_wilsons_interval_is_that_of_scipy(n: int, k: int) -> None:
    bounds = binomtest(k, n).proportion_ci(0.95, method="wilson")
    assert (wilson(k, n).low, wilson(k, n).high) == pytest.approx((bounds.low, bounds.high), abs=1e-12)


def test_trials_that_share_a_past_count_as_what_they_share() -> None:
    alike = [[True] * 8] * 20
    assert clustered(alike) == wilson(20, 20), "160 of 160 shoves of 20 robots"
    halves = [[True, False]] * 10
    assert clustered(halves) == wilson(10, 20), "what varies within a cluster as between counts in full"
    whole = [[True, True]] * 6 + [[False, False]] * 4
    # Each cluster is one trial, but for the m / (m - 1) of its variance: 10 units become 9 and are held at 10.
    assert clustered(whole) == wilson(6, 10)


@pytest.mark.parametrize("n", [6, 9, 10, 30, 101])
def test_the_interval_of_a_median_covers_it_at_least_as_often_as_it_says(n: int) -> None:
    found = distribution(list(range(1, n + 1)))
    assert found is not None and found.median_interval is not None
    rank = round(found.median_interval.low)
    assert found.median_interval.high == n + 1 - rank
    # It misses when fewer than `rank` of n values, each below the median with probability 1/2, are on one side.
    missed = 2.0 * binom.cdf(rank - 1, n, 0.5)
    assert missed <= 0.05 < 2.0 * binom.cdf(rank, n, 0.5)
