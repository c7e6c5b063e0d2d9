"""What each exchanged module is worth: paired differences with intervals, and Shapley's shares of them.

A game per trial: v(S) is 1 where the trial succeeds with the modules in S exchanged. Lost trials are run again, of the
won ones a sample, for the harm. The share of all trials that an exchange wins is p01, that it loses p10; points are
p01 - p10. Its interval is Newcombe's method 10 (Statistics in Medicine 17 (1998) 2635) in the form of MOVER (Zou and
Donner, Statistics in Medicine 27 (2008) 1693): Wilson's intervals of both cells, joined by the correlation of two cells
of a multinomial, -sqrt(p01 p10 / ((1 - p01) (1 - p10))). Where only n of a stratum's trials were run again, of weight w
among all, a cell counts as one of n / w trials: that is right for the stratum and no less than the truth for both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from golem.evaluation.metrics.statistics import Interval, difference, wilson

Coalition = frozenset[str]
EXACT = 6
"""Modules up to which all coalitions are run."""
ORDERS = 8
"""Orders that are drawn where there are more, half of them the others reversed."""


@dataclass(frozen=True, slots=True)
class Strata:
    """The trials of a run.

    Attributes:
        lost, won: how many there are.
        lost_run, won_run: keys (method, case, index) of those that are run again.
        alike: trials that share a scene, and count as one in intervals.
    """

    lost: int
    won: int
    lost_run: tuple[Any, ...]
    won_run: tuple[Any, ...]
    alike: int = 1

    @property
    def n(self) -> int:
        """All trials."""
        return self.lost + self.won


@dataclass(frozen=True, slots=True)
class Points:
    """What an exchange is worth: share of all trials, its 95 % interval, and the lower end that `names` it."""

    value: float
    interval: Interval
    proved: bool


def points(strata: Strata, gains: Mapping[Any, float], compared: int = 1) -> Points:
    """Return the points of what changes each trial's success by `gains` (-1 to 1), by key.

    Args:
        gains: of every trial that was run again.
        compared: how many are compared; one is proved where the lower bound of 95 % for all of them is above 0
            (Bonferroni, one-sided).
    """
    parts = [(strata.lost_run, strata.lost / strata.n), (strata.won_run, strata.won / strata.n)]
    cells: list[tuple[float, float]] = []  # share, and trials that it counts as
    for sign, own in ((1.0, 0), (-1.0, 1)):
        share, units = 0.0, math.inf
        for k, (keys, weight) in enumerate(parts):
            mine = [max(sign * gains[key], 0.0) for key in keys]
            share += weight * sum(mine) / max(len(mine), 1)
            if weight and (k == own or any(mine)):
                units = min(units, len(mine) / weight / strata.alike)
        cells.append((share, units))
    proved = _mover(cells, 1.0 - 0.1 / compared).low > 0.0
    return Points(cells[0][0] - cells[1][0], _mover(cells, 0.95), proved)


def _mover(cells: Sequence[tuple[float, float]], level: float) -> Interval:
    (p, _), (q, _) = cells
    ends = [wilson(share * u, u, level) if 0.0 < u < math.inf else Interval(0.0, float(u == 0.0)) for share, u in cells]
    product = (1.0 - p) * (1.0 - q)
    r = -math.sqrt(p * q / product) if product > 0.0 else 0.0
    found = difference(p, ends[0], q, ends[1], r)
    return Interval(max(found.low, -1.0), min(found.high, 1.0))


def orders_of(players: Sequence[str], rng: np.random.Generator) -> list[tuple[str, ...]]:
    """Return the orders over which Shapley's shares are a mean: all of up to `EXACT` players, else `ORDERS` drawn."""
    if len(players) <= EXACT:
        return list(permutations(players))
    drawn = [tuple(str(name) for name in rng.permutation(list(players))) for _ in range(ORDERS // 2)]
    return [order for one in drawn for order in (one, one[::-1])]


def coalitions(orders: Sequence[tuple[str, ...]]) -> list[Coalition]:
    """Return the coalitions that `orders` need, small ones first."""
    found = dict.fromkeys(frozenset(order[:k]) for order in orders for k in range(len(order) + 1))
    return sorted(found, key=lambda who: (len(who), sorted(who)))


def shapley(orders: Sequence[tuple[str, ...]], value: Callable[[Coalition], float]) -> dict[str, float]:
    """Return Shapley's share of each player (1953): the mean of what it adds in `orders` (drawn: Castro et al. 2009).

    The shares sum to the value of all players less that of none.
    """
    share = dict.fromkeys(orders[0], 0.0)
    for order in orders:
        for k, name in enumerate(order):
            share[name] += (value(frozenset(order[: k + 1])) - value(frozenset(order[:k]))) / len(orders)
    return share
