"""Runs of true values."""

from __future__ import annotations

import pytest

from golem.true_runs import true_runs


@pytest.mark.parametrize(
    ("flags", "runs"),
    [([], []), ([0, 0], []), ([1], [[0, 1]]), ([1, 1, 0, 1], [[0, 2], [3, 4]]), ([0, True, 2, 0], [[1, 3]])],
)
def test_runs_begin_and_end(flags: list[int], runs: list[list[int]]) -> None:
    found = true_runs(flags)
    assert found.shape == (len(runs), 2) and found.tolist() == runs
