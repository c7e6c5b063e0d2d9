from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.blame.game import Strata, coalitions, orders_of, points, shapley


def test_shares_of_a_known_game_are_shapleys() -> None:
    # The glove game: one left glove, two right ones; 2/3, 1/6 and 1/6 (Shapley 1953).
    def worth(who: frozenset[str]) -> float:
        return float("left" in who and bool(who & {"a", "b"}))

    orders = orders_of(("left", "a", "b"), np.random.default_rng(0))
    assert len(coalitions(orders)) == 8
    assert shapley(orders, worth) == pytest.approx({"left": 2 / 3, "a": 1 / 6, "b": 1 / 6})


def test_drawn_orders_sum_to_the_whole_and_ask_only_for_what_they_drew() -> None:
    rng, players = np.random.default_rng(0), tuple("abcdefgh")
    orders = orders_of(players, rng)
    table = {who: rng.random() for who in coalitions(orders)}
    assert len(table) < 2 ** len(players)
    shares = shapley(orders, table.__getitem__)
    assert sum(shares.values()) == pytest.approx(table[frozenset(players)] - table[frozenset()])


def test_an_interval_covers_what_is_true() -> None:
    rng, hits, proved = np.random.default_rng(0), 0, 0
    for _ in range(400):
        kind = rng.choice(4, 40, p=(0.2, 0.05, 0.1, 0.65))  # won by it, lost by it, lost, won
        lost = tuple(i for i in range(40) if kind[i] in (0, 2))
        won = tuple(i for i in range(40) if kind[i] in (1, 3))
        strata = Strata(len(lost), len(won), lost, won[:15])
        gains = {i: float(kind[i] == 0) - float(kind[i] == 1) for i in (*lost, *won[:15])}
        found = points(strata, gains)
        hits += found.interval.low <= 0.15 <= found.interval.high
        proved += points(strata, dict.fromkeys(gains, 0.0), 10).proved
    assert hits >= 0.94 * 400
    assert proved == 0


def test_trials_of_one_scene_widen_the_interval() -> None:
    keys = tuple(range(20))
    narrow, wide = (points(Strata(20, 0, keys, (), alike), dict.fromkeys(keys, 1.0)).interval for alike in (1, 2))
    assert wide.low < narrow.low


def test_harm_that_was_not_looked_at_may_be_all() -> None:
    keys = tuple(range(10))
    found = points(Strata(10, 10, keys, ()), dict.fromkeys(keys, 1.0))
    assert found.value == 0.5 and found.interval.low < 0.0 and not found.proved
