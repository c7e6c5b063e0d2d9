"""The margins are those of the samples that were looked at."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scripts.gate_margins import ROWS, MarginWatch

from golem.hardware.safety.senses import FORGET
from golem.interfaces import topics
from golem.middleware.bus import Bus
from golem.types import NUM_JOINTS, TICK, Imu, LowState


def watched(n: int, jump: float = 0.0, rate: float = 0.0) -> dict[str, float]:
    """Return the extremes of `n` noisy samples at rest, one joint jumping half way, the gyro reporting `rate` more."""
    bus, rng = Bus(), np.random.default_rng(0)
    watch = MarginWatch(cast(Any, SimpleNamespace(bus=bus, stack=SimpleNamespace(limits="urdf"))))
    for k in range(n):
        q, dq, tau = 1e-5 * rng.standard_normal((3, NUM_JOINTS))
        q[4] += jump if k >= n // 2 else 0.0
        gyro = 1e-4 * rng.standard_normal(3) + np.array([rate, 0.0, 0.0])
        quat = np.array([1.0, 0.0, 0.0, 0.0]) + 1e-9 * rng.standard_normal(4)
        imu = Imu(quat, gyro, np.array([0.0, 0.0, 9.81]) + 1e-3 * rng.standard_normal(3))
        bus.publish(topics.LOW_STATE, LowState(k * TICK, q, dq, tau, imu), k * TICK)
        watch()
        watch()  # nothing new is no second sample
    return watch.most


def test_a_calm_robot_is_far_from_every_limit() -> None:
    most = watched(600)
    assert set(most) == set(ROWS)
    assert all(most[name] < 0.3 * limit for name, limit in ROWS.items())


def test_what_comes_near_a_limit_is_seen() -> None:
    assert watched(600, jump=0.05)["jump of a joint in a tick [rad]"] == pytest.approx(0.05, rel=0.01)
    assert watched(600, jump=0.05)["drift of a joint [rad]"] == pytest.approx(0.05, rel=0.1)
    apart = 0.1 * FORGET * (1.0 - math.exp(-600 * TICK / FORGET))
    assert watched(600, rate=0.1)["orientation against rate [rad]"] == pytest.approx(apart, rel=0.02)
