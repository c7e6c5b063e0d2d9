"""Intervals and tests that hold at whatever moment one stops: confidence sequences and e-processes.

An e-process of a hypothesis is a wager that nobody can expect to gain from while the hypothesis is true: the chance
that it ever exceeds 1 / alpha is at most alpha (Ville's inequality). So trials may be added and looked at at any time.
Trials must be alike and independent: seeds are. Arrays end in the axis of time; those before it are studies.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from golem.evaluation.metrics.statistics import Interval
from golem.types import Array

ALPHA = 0.05
GRID = 1000
"""Means that a confidence sequence tries, evenly between 0 and 1."""
STAKE = 0.75
"""Most of its capital that a wager risks on one trial (c of WSR24, (26))."""
PRIOR = 0.5
"""Of the mixture over how often the better method wins a pair that differs: Beta(PRIOR, PRIOR)."""
BLOCK_PRIOR = 0.18
"""Of each method's success, Beta: what Turner, Ly and Gruenwald (2024) recommend for tables of two by two."""


def log_capital(values: ArrayLike, means: ArrayLike, alpha: float = ALPHA, n: int | None = None) -> Array:
    """Return the logarithm of the hedged capital against each of `means`, after each value.

    Waudby-Smith and Ramdas, Estimating means of bounded random variables by betting, JRSS B 86 (2024): the hedged
    capital of (22), in its form with the larger of the two wagers, and the predictable plug-in stakes of (26).

    Args:
        values: (..., T), each between 0 and 1.
        means: (G,) hypotheses.
        alpha: error for which the stakes are best.
        n: number of values where it was fixed in advance, for which the stakes are then best; the result holds for any.

    Returns:
        (..., T, G); a mean is refuted at level alpha once it exceeds log(1 / alpha).
    """
    return np.maximum(*_wagers(values, means, alpha, n))


def _wagers(values: ArrayLike, means: ArrayLike, alpha: float, n: int | None = None) -> tuple[Array, Array]:
    """Return `log_capital` of each wager alone: that the mean is above each of `means`, and that it is below."""
    x, m = np.asarray(values, np.float64), np.asarray(means, np.float64)
    stake, gain = _stakes(x, alpha, n)[..., None], x[..., None] - m
    with np.errstate(divide="ignore"):
        up, down = np.minimum(stake, STAKE / m), np.minimum(stake, STAKE / (1.0 - m))
    above, below = (np.cumsum(np.log1p(bet * gain), axis=-2) - math.log(2.0) for bet in (up, -down))
    return above, below


def confidence_sequence(values: ArrayLike, alpha: float = ALPHA, n: int | None = None) -> tuple[Array, Array]:
    """Return lower and upper end, each (T,), of the interval of the mean of `values`, (T,) between 0 and 1.

    With probability 1 - alpha it holds the true mean at all times at once; see `log_capital`.
    """
    means = np.linspace(0.0, 1.0, GRID + 1)
    kept = np.maximum.accumulate(log_capital(values, means, alpha, n), axis=-2) < math.log(1.0 / alpha)
    low = np.argmax(kept, axis=-1)
    high = GRID - np.argmax(kept[..., ::-1], axis=-1)
    # What lies between two means of the grid is not refuted with the outer one; an empty set is the last one's ends.
    ends = np.maximum(low - 1, 0) / GRID, np.minimum(high + 1, GRID) / GRID
    return ends[0], np.maximum(ends[1], ends[0])


def anytime_interval(values: ArrayLike, n: int | None = None) -> Interval:
    """Return the confidence sequence's 95 % interval after all `values`, (T,) between 0 and 1, at least one.

    No distribution is assumed; `n` is their number where it was fixed in advance.
    """
    low, high = confidence_sequence(values, n=n)
    return Interval(float(low[-1]), float(high[-1]))


def difference_interval(a: ArrayLike, b: ArrayLike) -> Interval:
    """Return the confidence sequence's interval of the mean of `a` minus that of `b`, (T,) pairs between 0 and 1."""
    found = anytime_interval((1.0 + np.asarray(a, np.float64) - np.asarray(b, np.float64)) / 2.0)
    return Interval(2.0 * found.low - 1.0, 2.0 * found.high - 1.0)


def paired_evidence(a: ArrayLike, b: ArrayLike) -> Array:
    """Return the logarithm of the e-process against "a and b are equally good", after each of (..., T) pairs.

    Of yes and no: that either is as likely to win a pair that differs, which is McNemar's hypothesis. A mixture of
    likelihood ratios over a Beta prior (Robbins, Ann. Math. Stat. 41 (1970) 1397): with k of d such pairs won by `a`,
    E = 2^d B(k + g, d - k + g) / B(g, g). Of scores between 0 and 1: that their mean difference is 0, by the mean of
    the two wagers of `log_capital`.
    """
    from scipy.special import betaln

    first, second = np.asarray(a, np.float64), np.asarray(b, np.float64)
    if not (_is_binary(first) and _is_binary(second)):
        values = (1.0 + first - second) / 2.0
        bet = np.minimum(_stakes(values, ALPHA), 2.0 * STAKE) * (values - 0.5)
        return np.logaddexp(np.cumsum(np.log1p(bet), axis=-1), np.cumsum(np.log1p(-bet), axis=-1)) - math.log(2.0)
    won = np.cumsum(first > second, axis=-1)
    d = np.cumsum(first != second, axis=-1)
    return betaln(won + PRIOR, d - won + PRIOR) - betaln(PRIOR, PRIOR) + d * math.log(2.0)


def unpaired_evidence(a: ArrayLike, b: ArrayLike) -> Array:
    """Return the logarithm of the e-process against equal success, after each of (..., T) blocks of an `a` and a `b`.

    Turner, Ly and Gruenwald, Generic e-variables for exact sequential k-sample tests that allow for optional stopping,
    J. Stat. Plan. Inference 230 (2024), for blocks of two: the likelihood of the two rates that were learnt from the
    blocks before, over that of their mean. Scenes need not be the same.
    """
    first, second = np.asarray(a, np.float64), np.asarray(b, np.float64)
    rates = [_learnt(side) for side in (first, second)]
    middle = (rates[0] + rates[1]) / 2.0
    steps = [_log_chance(side, p) - _log_chance(side, middle) for side, p in zip((first, second), rates, strict=True)]
    return np.cumsum(steps[0] + steps[1], axis=-1)


def evidence(a: Array, b: Array, paired: bool) -> Array:
    """Return the logarithm of the e-process against "a and b are equally good"; scores are always taken as pairs."""
    pairs = paired or not (_is_binary(a) and _is_binary(b))
    return paired_evidence(a, b) if pairs else unpaired_evidence(a, b)


def anytime_p(log_evidence: Array) -> Array:
    """Return the p-values, (..., T), which hold at any time: one over the largest evidence so far."""
    return np.minimum(np.exp(-np.maximum.accumulate(log_evidence, axis=-1)), 1.0)


def equal_within(a: ArrayLike, b: ArrayLike, margin: float, alpha: float = ALPHA) -> NDArray[np.bool_]:
    """Return after each of (..., T) pairs whether a difference of `margin` or more, either way, is refuted."""
    values = (1.0 + np.asarray(a, np.float64) - np.asarray(b, np.float64)) / 2.0
    above, below = _wagers(values, [(1.0 - margin) / 2.0, (1.0 + margin) / 2.0], alpha)
    # What lies beyond one end refutes both, and is no equality: each end counts from its inner side.
    worst = np.minimum(*(np.maximum.accumulate(x, axis=-1) for x in (above[..., 0], below[..., 1])))
    return worst >= math.log(1.0 / alpha)


def _is_binary(x: Array) -> bool:
    return bool(np.isin(x, (0.0, 1.0)).all())


def _stakes(x: Array, alpha: float, n: int | None = None) -> Array:
    """Return what is risked on each value, by the mean and variance of those before it."""
    t = np.arange(1, x.shape[-1] + 1)
    mean = (0.5 + np.cumsum(x, axis=-1)) / (t + 1)
    variance = (0.25 + np.cumsum((x - mean) ** 2, axis=-1)) / (t + 1)
    before = np.concatenate([np.full((*x.shape[:-1], 1), 0.25), variance[..., :-1]], axis=-1)
    return np.sqrt(2.0 * math.log(2.0 / alpha) / (before * (t * np.log(t + 1) if n is None else n)))


def _learnt(x: Array) -> Array:
    """Return before each value the mean of what is known of its rate."""
    t = np.arange(x.shape[-1])
    return (BLOCK_PRIOR + np.cumsum(x, axis=-1) - x) / (2.0 * BLOCK_PRIOR + t)


def _log_chance(x: Array, rate: Array) -> Array:
    return np.log(np.where(x > 0.5, rate, 1.0 - rate))
