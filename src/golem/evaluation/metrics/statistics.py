"""Intervals and tests for success rates and times of paired trials."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np


@dataclass(frozen=True, slots=True)
class Interval:
    """A two-sided confidence interval."""

    low: float
    high: float

    def text(self, scale: float, sign: str = "") -> str:
        """Return both ends times `scale`, as `[low, high]`; with `sign` `+` a positive one shows it."""
        return f"[{scale * self.low:{sign}.3g}, {scale * self.high:{sign}.3g}]"


@dataclass(frozen=True, slots=True)
class Distribution:
    """What is quoted of `n` values, in their unit.

    Attributes:
        mean, mean_interval: with its 95 % interval, see `mean_interval`.
        median, median_interval: with the 95 % interval between two of the values, which assumes no distribution;
            None for fewer than six.
        q1, q3: quartiles (linear interpolation).
        p95_size: 95 % quantile of the absolute values.
    """

    n: int
    mean: float
    mean_interval: Interval | None
    median: float
    median_interval: Interval | None
    q1: float
    q3: float
    rms: float
    p95_size: float
    minimum: float
    maximum: float


@dataclass(frozen=True, slots=True)
class PairedTable:
    """Counts of paired trials of two methods A and B."""

    both: int
    only_a: int
    only_b: int
    neither: int

    @classmethod
    def count(cls, a: Sequence[bool], b: Sequence[bool]) -> PairedTable:
        """Count the successes `a` and `b` of the same trials, in the same order."""
        pairs = list(zip(a, b, strict=True))
        return cls(*(pairs.count(cell) for cell in ((True, True), (True, False), (False, True), (False, False))))

    @property
    def n(self) -> int:
        """Number of pairs."""
        return self.both + self.only_a + self.only_b + self.neither


def wilson(successes: float, n: float, confidence: float = 0.95) -> Interval:
    """Return the Wilson score interval of a success rate, without continuity correction."""
    z = NormalDist().inv_cdf(0.5 + confidence / 2)
    centre, z2 = successes + z * z / 2, z * z
    half = z * math.sqrt(successes * (n - successes) / n + z2 / 4)
    low = 0.0 if successes == 0 else (centre - half) / (n + z2)
    return Interval(low, 1.0 if successes == n else (centre + half) / (n + z2))


def clustered(clusters: Sequence[Sequence[bool]]) -> Interval:
    """Return the 95 % interval of a success rate whose trials come in `clusters` that share a past.

    Wilson's with the number of trials divided by the design effect, of the ratio estimator (Kish, Survey Sampling,
    1965). Where all trials end alike that is unknown, and a cluster counts as one trial.
    """
    m, n = len(clusters), sum(map(len, clusters))
    rate = sum(map(sum, clusters)) / n
    units = float(m)
    if 0.0 < rate < 1.0 and m > 1:
        spread = sum((sum(one) - rate * len(one)) ** 2 for one in clusters) * m / (m - 1)
        units = min(max(rate * (1.0 - rate) * n * n / spread if spread else n, m), n)
    return wilson(rate * units, units)


def mcnemar(table: PairedTable) -> float:
    """Return the two-sided exact McNemar p-value: a sign test on the discordant pairs; 1 where there are none."""
    discordant = table.only_a + table.only_b
    if discordant == 0:
        return 1.0
    from scipy.stats import binomtest

    return float(binomtest(table.only_a, discordant, 0.5).pvalue)


def paired_difference(table: PairedTable) -> Interval:
    """Return the 95 % interval of the difference of success rates, A minus B, of paired trials.

    Method 10 of Newcombe, Statistics in Medicine 17 (1998) 2635: the two Wilson intervals, joined by the
    continuity-corrected correlation of the pairs. Needs at least one pair.
    """
    n = table.n
    a, b = table.both + table.only_a, table.both + table.only_b
    wilson_a, wilson_b = wilson(a, n), wilson(b, n)
    rate_a, rate_b = a / n, b / n
    determinant = table.both * table.neither - table.only_a * table.only_b
    if determinant > 0:
        determinant = max(determinant - n / 2, 0)
    product = a * (n - a) * b * (n - b)
    return difference(rate_a, wilson_a, rate_b, wilson_b, determinant / math.sqrt(product) if product else 0.0)


def difference(a: float, of_a: Interval, b: float, of_b: Interval, r: float) -> Interval:
    """Return the interval of `a` minus `b` by the interval of each, and the correlation `r` of the two.

    MOVER of Zou and Donner, Statistics in Medicine 27 (2008) 1693.
    """

    def reach(da: float, db: float) -> float:
        return math.sqrt(max(da * da - 2.0 * r * da * db + db * db, 0.0))

    return Interval(a - b - reach(a - of_a.low, of_b.high - b), a - b + reach(of_a.high - a, b - of_b.low))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for their number by the step-down method of Holm (1979), in the same order."""
    p, adjusted = np.array(p_values, dtype=np.float64), np.empty(len(p_values))
    order = np.argsort(p, kind="stable")
    adjusted[order] = np.maximum.accumulate(np.minimum(np.arange(len(p), 0, -1) * p[order], 1.0))
    return adjusted.tolist()


def distribution(values: Sequence[float], low: float = -math.inf, high: float = math.inf) -> Distribution | None:
    """Return what is quoted of `values`, which must lie between `low` and `high`; None for no values."""
    if not len(values):
        return None
    x = np.sort(np.array(values, dtype=np.float64))
    q1, median, q3 = (float(q) for q in np.percentile(x, (25, 50, 75)))
    return Distribution(
        n=len(x),
        mean=float(x.mean()),
        mean_interval=mean_interval(values, low, high),  # bets on each value by those before: never in order of size
        median=median,
        median_interval=_median_interval(x.tolist()),
        q1=q1,
        q3=q3,
        rms=float(np.sqrt((x * x).mean())),
        p95_size=float(np.quantile(np.abs(x), 0.95)),
        minimum=float(x[0]),
        maximum=float(x[-1]),
    )


def mean_interval(values: Sequence[float], low: float = -math.inf, high: float = math.inf) -> Interval | None:
    """Return the 95 % interval of the mean of `values`, which must lie between `low` and `high`.

    Of values that are each 0 or 1, and can be nothing beyond, it is Wilson's; of values between two bounds it is
    `anytime_interval` for so many, which assumes no distribution. Else it is Student's t, cut at the bound: what cannot
    be is taken out of an interval without a loss of coverage. None for values that are all alike, which say nothing
    about how they spread.
    """
    n = len(values)
    if n and (low, high) == (0.0, 1.0) and set(values) <= {0.0, 1.0}:
        return wilson(sum(values), n)
    if n and math.isfinite(low) and math.isfinite(high):
        from golem.evaluation.metrics.anytime import anytime_interval

        found = anytime_interval((np.array(values) - low) / (high - low), n=n)
        return Interval(low + (high - low) * found.low, low + (high - low) * found.high)
    if len(set(values)) < 2:
        return None
    from scipy.stats import t as student

    half = float(student.ppf(0.975, n - 1) * np.std(values, ddof=1) / math.sqrt(n))
    mean = float(np.mean(values))
    return Interval(max(mean - half, low), min(mean + half, high))


def _median_interval(ordered: Sequence[float]) -> Interval | None:
    """Return the median's 95 % interval between two order statistics (Conover, Practical Nonparametric Statistics)."""
    n = len(ordered)
    from scipy.stats import binom

    rank = int(binom.ppf(0.025, n, 0.5))
    return Interval(ordered[rank - 1], ordered[n - rank]) if rank >= 1 else None
