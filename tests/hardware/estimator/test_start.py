"""Before a foot has carried load there is nothing to rely on."""

from __future__ import annotations

import numpy as np
import pytest

from golem.hardware.estimator.base import BaseEstimator
from golem.hardware.estimator.invariant_ekf import InvariantEKF
from golem.hardware.estimator.random_walk_kf import RandomWalkKF
from golem.types import NUM_JOINTS, Imu, LowState


@pytest.mark.parametrize("kind", [RandomWalkKF, InvariantEKF])
def test_an_estimate_is_stale_until_a_foot_has_carried_load(kind: type[BaseEstimator]) -> None:
    zero = np.zeros(NUM_JOINTS)
    hanging = LowState(0.0, zero, zero, zero, Imu(np.array([1.0, 0, 0, 0]), np.zeros(3), np.array([0, 0, 9.81])))
    estimator = kind()
    estimator.reset(hanging)
    assert all(estimator.step(hanging, 0.002).stale for _ in range(50))
