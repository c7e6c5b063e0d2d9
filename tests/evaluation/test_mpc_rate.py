from __future__ import annotations

import numpy as np

from golem.evaluation.mpc_rate import plan_seconds


def test_a_plan_costs_what_its_rollouts_cost() -> None:
    few, many = np.median(plan_seconds(4, plans=5)), np.median(plan_seconds(32, plans=5))
    assert 0.0 < 2.0 * few < many < 0.5
