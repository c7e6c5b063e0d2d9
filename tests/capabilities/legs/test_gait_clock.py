"""The compiled clock does what its description in plain NumPy does, of one robot and of many."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from tests.capabilities.legs.clock_twin import ClockTwin, stand_errors
from tests.capabilities.legs.recorder import crouching

from golem.capabilities.legs.balance_errors import VelocityIntegrator, VelocityIntegratorConfig, balance_errors
from golem.capabilities.legs.gait import Gait, GaitConfig
from golem.capabilities.legs.gait_clock import GaitClock, StopPredictor
from golem.robots.model.spatial import rotation_rpy
from golem.types import BaseEstimate, Imu, LowState, Twist

DT = 0.01
EXACT = 1e-12
Start = Literal["never", "command", "balance", "recovery", "always"]


def robots(rng: np.random.Generator, shake: float) -> tuple[LowState, BaseEstimate]:
    """Return a robot near its crouch, somewhere, facing anywhere."""
    q = crouching().q + rng.normal(0.0, 0.03 * shake, 27)
    imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), rng.normal(0.0, 0.1 * shake, 3), np.zeros(3))
    T = np.eye(4)
    roll, pitch = rng.normal(0.0, 0.03 * shake, 2)
    T[:3, :3] = rotation_rpy(roll, pitch, rng.uniform(-3.2, 3.2))
    T[:3, 3] = rng.normal(0.0, 2.0, 3)
    base = BaseEstimate(0.0, T, rng.normal(0.0, 0.1 * shake, 3), 0.9, rng.uniform(0.0, 1.0, 2))
    return LowState(0.0, q, rng.normal(0.0, 0.1, 27), np.zeros(27), imu), base


@pytest.mark.parametrize("trim", [None, VelocityIntegratorConfig(gain=0.5, heed=(0.1, 0.2, 0.3))])
@pytest.mark.parametrize("start", ["never", "command", "balance", "recovery", "always"])
def test_every_tick_is_that_of_the_twin(start: Start, trim: VelocityIntegratorConfig | None) -> None:
    rng = np.random.default_rng(3)
    config = GaitConfig(start=start, patience=0.2, capture_stop=0.2, feet_stop=0.11)
    gait, rest = Gait(config), StopPredictor()
    clock = GaitClock(gait, rest, None if trim is None else VelocityIntegrator(trim))
    twin = ClockTwin(config, trim)
    stepped = 0
    for i in range(900):
        state, base = robots(rng, shake=2.0 if i % 300 > 250 else 0.2)
        twist = np.array([0.3, -0.1, 0.2]) if i % 300 > 120 and i % 300 < 200 else np.zeros(3)
        out = clock.step(state, base, Twist(*twist.tolist()), DT)
        np.testing.assert_allclose(out, twin.step(state, base, twist, DT), rtol=0.0, atol=EXACT)
        assert bool(gait.stepping) == twin.stepping
        stepped += twin.stepping
        np.testing.assert_allclose(gait.phases, [twin.phase, (twin.phase + 0.5) % 1.0], rtol=0.0, atol=EXACT)
        place = twin.rest.x, twin.rest.y, twin.rest.yaw
        np.testing.assert_allclose((rest.pose.x, rest.pose.y, rest.pose.yaw), place, rtol=0.0, atol=EXACT)
    assert (stepped == 0) == (start == "never")
    assert (stepped == 900) == (start == "always")


def test_many_robots_are_many_twins() -> None:
    rng, n = np.random.default_rng(4), 6
    config = GaitConfig(capture_stop=0.1)
    gait, twins = Gait(config, (2, 3)), [ClockTwin(config, None) for _ in range(n)]
    ticks = 0
    for i in range(400):
        commanded, scale = rng.uniform(size=(2, 3)) < 0.01, 0.15 if i % 100 > 90 else 0.03
        capture, misplaced = rng.normal(0.0, scale, (2, 3, 2)), np.abs(rng.normal(0.0, 0.04, (2, 3)))
        if i == 200:
            chosen = np.array([[True, False, False], [False, True, False]])
            gait.reset(chosen)
            for twin, now in zip(twins, chosen.reshape(-1), strict=True):
                twin.phase, twin.stepping = (0.0, False) if now else (twin.phase, twin.stepping)
        gait.step(commanded, capture, misplaced, DT)
        for k, twin in enumerate(twins):
            at = divmod(k, 3)
            twin.step_gait(bool(commanded[at]), capture[at], float(misplaced[at]), DT)
        np.testing.assert_array_equal(gait.stepping.reshape(-1), [twin.stepping for twin in twins])
        np.testing.assert_allclose(gait.phase.reshape(-1), [t.phase for t in twins], rtol=0.0, atol=EXACT)
        ticks += int(gait.stepping.sum())
    assert 0 < ticks < 400 * n


def test_the_balance_errors_of_many_are_those_of_each() -> None:
    rng, shape = np.random.default_rng(5), (3, 4)
    R = np.array([rotation_rpy(*x) for x in rng.normal(0.0, 0.7, (12, 3))]).reshape(3, 4, 3, 3)
    com, velocity, soles = (rng.normal(size=(*shape, 3)), rng.normal(size=(*shape, 3)), rng.normal(size=(*shape, 2, 3)))
    stance = np.array([0.02, 0.3])
    capture, misplaced = balance_errors(R, com, velocity, soles, stance)
    for at in np.ndindex(*shape):
        expected = stand_errors(R[at], com[at], velocity[at], soles[at], stance)
        np.testing.assert_allclose(capture[at], expected[0], rtol=0.0, atol=EXACT)
        assert misplaced[at] == pytest.approx(expected[1], abs=EXACT)
