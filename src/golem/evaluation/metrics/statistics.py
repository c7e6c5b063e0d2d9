"""Intervals and tests for success rates and times of paired trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest


@dataclass(frozen=True, slots=True)
class Interval:
    """A two-sided confidence interval."""

    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Spread:
    """Median and quartiles of `n` values, in the unit of the values."""

    n: int
    median: float
    q1: float
    q3: float


@dataclass(frozen=True, slots=True)
class PairedTable:
    """Counts of paired trials of two methods A and B.

    Attributes:
        both: both succeeded.
        only_a: A succeeded and B did not.
        only_b: B succeeded and A did not.
        neither: both failed.
    """

    both: int
    only_a: int
    only_b: int
    neither: int

    @classmethod
    def count(cls, a: Sequence[bool], b: Sequence[bool]) -> PairedTable:
        """Count the successes `a` and `b` of the same trials, in the same order."""
        pairs = list(zip(a, b, strict=True))
        return cls(
            *(pairs.count(cell) for cell in ((True, True), (True, False), (False, True), (False, False)))
        )

    @property
    def n(self) -> int:
        """Number of pairs."""
        return self.both + self.only_a + self.only_b + self.neither


def wilson(successes: int, n: int, confidence: float = 0.95) -> Interval:
    """Return the Wilson score interval of a success rate, without continuity correction.

    Args:
        successes: number of successes, 0 to n.
        n: number of independent trials, > 0.
        confidence: coverage, 0 to 1.
    """
    bounds = binomtest(successes, n).proportion_ci(confidence, method="wilson")
    return Interval(float(bounds.low), float(bounds.high))


def mcnemar(table: PairedTable) -> float:
    """Return the two-sided exact McNemar p-value: a sign test on the discordant pairs; 1 where there are none."""
    discordant = table.only_a + table.only_b
    if discordant == 0:
        return 1.0
    return float(binomtest(table.only_a, discordant, 0.5).pvalue)


def paired_difference(table: PairedTable, confidence: float = 0.95) -> Interval:
    """Return the interval of the difference of success rates, A minus B, of paired trials.

    Method 10 of Newcombe, Statistics in Medicine 17 (1998) 2635: the two Wilson intervals, joined by the
    continuity-corrected correlation of the pairs. Needs at least one pair.
    """
    n = table.n
    a, b = table.both + table.only_a, table.both + table.only_b
    wilson_a, wilson_b = wilson(a, n, confidence), wilson(b, n, confidence)
    rate_a, rate_b = a / n, b / n
    determinant = table.both * table.neither - table.only_a * table.only_b
    if determinant > 0:
        determinant = max(determinant - n / 2, 0)
    product = a * (n - a) * b * (n - b)
    phi = determinant / math.sqrt(product) if product else 0.0

    def reach(da: float, db: float) -> float:
        return math.sqrt(max(da * da - 2 * phi * da * db + db * db, 0.0))

    difference = rate_a - rate_b
    return Interval(
        difference - reach(rate_a - wilson_a.low, wilson_b.high - rate_b),
        difference + reach(wilson_a.high - rate_a, rate_b - wilson_b.low),
    )


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for their number by the step-down method of Holm (1979), in the same order."""
    order = sorted(range(len(p_values)), key=lambda i: p_values[i])
    adjusted = [0.0] * len(p_values)
    floor = 0.0
    for rank, i in enumerate(order):
        floor = max(floor, min(1.0, (len(p_values) - rank) * p_values[i]))
        adjusted[i] = floor
    return adjusted


def spread(values: Sequence[float]) -> Spread | None:
    """Return median and quartiles (linear interpolation), or None for no values."""
    if not values:
        return None
    q1, median, q3 = (float(q) for q in np.percentile(values, (25, 50, 75)))
    return Spread(len(values), median, q1, q3)
