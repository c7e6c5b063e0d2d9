"""The stand-in for a LiDAR odometry has the noise, rate and latency it says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from golem.evaluation.episodes.episode import ODOMETRY_LATENCY, PERIOD, POSITION_NOISE, YAW_NOISE, SimulatedOdometry
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.robots.mujoco.engine import MujocoRobot
from golem.runtime.lockstep import start_posture
from golem.types import BaseEstimate


@pytest.mark.parametrize("source", ["estimator", "truth"])
def test_simulated_odometry_is_its_source_with_noise_at_its_rate(source: Any) -> None:
    bus, robot = Bus(), MujocoRobot("ideal", 0, start_posture())
    believed = np.eye(4)
    believed[:3, 3] = (1.0, 2.0, 0.0)
    odometry = SimulatedOdometry(bus, robot, source, np.random.default_rng(1))
    middle = believed[:2, 3] if source == "estimator" else np.zeros(2)
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
            x, y = found.T_odom_base[:2, 3] - middle
            errors.append((x, y, np.arctan2(found.T_odom_base[1, 0], found.T_odom_base[0, 0])))
    assert seen == pytest.approx(300.0 / PERIOD, abs=2)
    spread = np.std(errors, axis=0)
    assert spread == pytest.approx([POSITION_NOISE, POSITION_NOISE, YAW_NOISE], rel=0.1)
