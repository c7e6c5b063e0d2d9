"""A* against an exact solver that shares nothing with it, and its time."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from golem.capabilities.navigation.astar import astar
from golem.types import Array

CLOSED = 253.0


def oracle(cost: Array, start: tuple[int, int], goal: tuple[int, int], beta: float) -> float:
    """Return the least sum of the paper's equation by Dijkstra on the whole graph."""
    rows, columns = cost.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    one, other, weight = [], [], []
    for dr in (-1, 0, 1):
        for dc in (-1, 0, 1):
            if (dr, dc) == (0, 0):
                continue
            a = index[max(0, -dr) : rows - max(0, dr), max(0, -dc) : columns - max(0, dc)]
            b = index[max(0, dr) : rows + min(0, dr), max(0, dc) : columns + min(0, dc)]
            into = cost.ravel()[b.ravel()]
            kept = into < CLOSED
            one.append(a.ravel()[kept])
            other.append(b.ravel()[kept])
            weight.append((math.hypot(dr, dc) + beta * into)[kept])
    n = rows * columns
    entries = np.concatenate(weight), (np.concatenate(one), np.concatenate(other))
    graph = coo_matrix(entries, shape=(n, n)).tocsr()
    return float(dijkstra(graph, indices=index[start])[index[goal]])


def random_map(rng: np.random.Generator, side: int) -> Array:
    cost = rng.uniform(0.0, 252.0, (side, side)) * (rng.random((side, side)) < 0.6)
    cost[rng.random((side, side)) < rng.uniform(0.0, 0.7)] = 254.0
    return cost


def test_it_costs_what_the_exact_solver_finds_on_200_maps() -> None:
    rng = np.random.default_rng(0)
    blocked = 0
    for _ in range(200):
        side = int(rng.integers(8, 40))
        cost = random_map(rng, side)
        a, b, c, d = (int(v) for v in rng.integers(0, side, 4))
        start, goal = (a, b), (c, d)
        cost[start] = cost[goal] = 0.0
        beta = float(rng.choice([0.0, 0.01, 0.05, 1.0]))
        found, exact = astar(cost, start, goal, beta, CLOSED), oracle(cost, start, goal, beta)
        if found is None:
            assert not math.isfinite(exact)
            blocked += 1
            continue
        way, total = found
        assert total == pytest.approx(exact, rel=1e-12, abs=1e-9)
        steps = np.diff(way, axis=0)
        assert np.abs(steps).max(initial=0) <= 1
        entered = cost[tuple(way[1:].T)]
        assert (entered < CLOSED).all()
        assert float(np.linalg.norm(steps, axis=1).sum() + beta * entered.sum()) == pytest.approx(total)
        assert tuple(way[0]) == start and tuple(way[-1]) == goal
    assert 5 < blocked < 150


def test_400_by_400_is_fast() -> None:
    rng = np.random.default_rng(1)
    cost = np.zeros((400, 400))
    for r, c in rng.integers(0, 380, (60, 2)):
        cost[r : r + 20, c : c + 20] = 254.0
    cost[:5, :5] = cost[-5:, -5:] = 0.0
    astar(cost, (0, 0), (399, 399), 0.02, CLOSED)
    times = []
    for _ in range(5):
        start = time.thread_time()
        assert astar(cost, (0, 0), (399, 399), 0.02, CLOSED) is not None
        times.append(time.thread_time() - start)
    assert min(times) < 0.060  # three times what it takes on a quiet machine


def test_a_start_on_the_goal_is_a_way_of_one_cell() -> None:
    found = astar(np.zeros((3, 3)), (1, 1), (1, 1), 1.0, CLOSED)
    assert found is not None and found[0].tolist() == [[1, 1]] and found[1] == 0.0
