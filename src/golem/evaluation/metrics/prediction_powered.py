"""Real success from few real trials and many simulated ones: prediction-powered inference.

Angelopoulos, Bates, Fannjiang, Jordan and Zrnic (Science 382 (2023) 669) correct the simulated mean by the real one's
difference from it; Angelopoulos, Duchi and Zrnic (PPI++, arXiv 2311.01453, 2023) weigh the simulation by lambda:

    theta = mean(Y) + lambda (mean(f of the other simulated trials) - mean(f of the paired ones))
    lambda = cov(Y, f) / ((1 + n / N) var(f))

so that the variance, var(Y - lambda f) / n + lambda^2 var(f) / N, is least; a useless simulation gets lambda 0.
Their normal interval is too short for shares of few trials. Here it is Wilson's of `theta` for as many trials as the
variance is worth, n var(Y) / var, or that of the real trials alone where that is shorter (own choice; its coverage:
`scripts/ppi_check.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from golem.evaluation.metrics.statistics import Interval, wilson

FEWEST = 10
"""Paired trials below which no weight is estimated: lambda is then 0."""


@dataclass(frozen=True, slots=True)
class Powered:
    """A rate with its 95 % interval, that of the real trials alone, lambda, and how many real ones it is worth."""

    rate: float
    interval: Interval
    real: Interval
    weight: float
    worth: float


def prediction_powered(real: Sequence[float], paired: Sequence[float], others: Sequence[float]) -> Powered:
    """Return the real success rate.

    Args:
        real: outcomes of n >= 1 real trials, 0 or 1.
        paired: what the twin says of each of them, 0 to 1.
        others: the same of N more trials of the same cells, which were not run in reality.
    """
    y, f, g = (np.asarray(values, float) for values in (real, paired, others))
    n, count = len(y), len(g)
    alone = wilson(float(y.sum()), n)
    plain = Powered(float(y.mean()), alone, alone, 0.0, float(n))
    if min(n, count) < FEWEST or min(np.ptp(y), np.ptp(f)) == 0.0:
        return plain
    spread = float(np.var(np.concatenate([f, g]), ddof=1))
    weight = float(np.clip(np.cov(y, f)[0, 1] / ((1.0 + n / count) * spread), 0.0, 1.0))
    rate = float(np.clip(y.mean() + weight * (g.mean() - f.mean()), 0.0, 1.0))
    # A slope was fitted to the residuals, as in a regression: n - 2 degrees of freedom.
    left = y - weight * f
    variance = float(((left - left.mean()) ** 2).sum() / (n - 2) + weight**2 * spread * n / count)
    worth = n * float(np.var(y, ddof=1)) / variance if variance > 0.0 else float(n + count)
    worth = min(worth, n + count)
    from scipy.stats import norm
    from scipy.stats import t as student

    level = 2.0 * float(norm.cdf(student.ppf(0.975, n - 2))) - 1.0  # the variance is estimated
    interval = wilson(rate * worth, worth, level)
    if weight == 0.0 or interval.high - interval.low > alone.high - alone.low:
        return plain
    return Powered(rate, interval, alone, weight, worth)
