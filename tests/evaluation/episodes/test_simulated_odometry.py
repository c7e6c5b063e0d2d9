"""The stand-in for a LiDAR odometry has the noise, rate and latency it says."""

from __future__ import annotations

import numpy as np
import pytest

from golem.evaluation.episodes.episode import ODOMETRY_LATENCY, PERIOD, POSITION_NOISE, YAW_NOISE, SimulatedOdometry
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.types import BaseEstimate


def test_simulated_odometry_is_the_estimate_with_noise_at_its_rate() -> None:
    bus = Bus()
    believed = np.eye(4)
    believed[:3, 3] = (1.0, 2.0, 0.0)
    odometry = SimulatedOdometry(bus, np.random.default_rng(1))
    errors: list[tuple[float, float, float]] = []
    seen = 0
    for tick in range(30_000):
        t = 0.01 * tick
        bus.deliver(t)
        bus.publish(topics.BASE, BaseEstimate(t, believed), t)
        odometry(t)
        if bus.count(topics.ODOMETRY) > seen:
            seen = bus.count(topics.ODOMETRY)
            found = bus.latest(topics.ODOMETRY)
            assert found is not None and t - found.t >= ODOMETRY_LATENCY - 1e-9
            x, y = found.T_odom_base[:2, 3] - believed[:2, 3]
            errors.append((x, y, np.arctan2(found.T_odom_base[1, 0], found.T_odom_base[0, 0])))
    assert seen == pytest.approx(300.0 / PERIOD, abs=2)
    spread = np.std(errors, axis=0)
    assert spread == pytest.approx([POSITION_NOISE, POSITION_NOISE, YAW_NOISE], rel=0.1)
