"""Feet that are about to cross: who is led outward, and when nobody is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tests.capabilities.legs.recorder import Recorder, crouching, still

from golem.capabilities.legs.locomotion import FootSeparation, FootSeparationConfig, Locomotion, LocomotionConfig
from golem.interfaces.payloads import LegCommand
from golem.robots.model.leg_kernel import LegDynamics
from golem.types import LEGS, SIDES, Array, LowState, Twist

ROLLS = {"left": 2, "right": 8}
SWINGS = {"left": np.array([True, False]), "right": np.array([False, True])}


def leaning(angle: float, rate: float = 0.0) -> LowState:
    """A robot whose legs both lean inward by `angle` [rad], and at `rate` [rad/s]."""
    state = crouching()
    q, dq = state.q.copy(), state.dq.copy()
    for roll, share in zip(ROLLS.values(), (-1.0, 1.0), strict=True):
        q[roll] += share * angle
        dq[roll] += share * rate
    return replace(state, q=q, dq=dq)


def distance(q: Array) -> float:
    """Distance of the soles across base_link at the leg joints `q` (12,) [m]."""
    legs = LegDynamics()
    legs.update(q, np.zeros(12))
    return float(legs.soles[0, 1] - legs.soles[1, 1])


def command() -> LegCommand:
    return LegCommand(np.zeros(12), np.full(12, 100.0), np.full(12, 2.0), np.zeros(12))


@pytest.mark.parametrize("side", SIDES)
def test_only_the_hip_roll_of_the_leg_that_swings_is_led_outward(side: str) -> None:
    state = leaning(0.2)
    missing = FootSeparationConfig().minimum - distance(state.q[LEGS])
    assert missing > 0.04
    change = FootSeparation().step(command(), state, SWINGS[side]).q
    assert np.flatnonzero(change).tolist() == [ROLLS[side]]
    # Told to be there at once, without the gain that makes up for the leg's lag, it would stand as far off as wanted.
    q = state.q[LEGS] + change / FootSeparationConfig().gain
    assert distance(q) == pytest.approx(FootSeparationConfig().minimum, abs=0.005)


@pytest.mark.parametrize(("rate", "led"), [(0.0, False), (1.5, True), (-1.5, False)])
def test_feet_that_will_soon_be_too_near_are_seen_coming(rate: float, led: bool) -> None:
    state = leaning(0.05, rate)
    assert distance(state.q[LEGS]) > FootSeparationConfig().minimum + 0.05
    assert FootSeparation().step(command(), state, SWINGS["left"]).q.any() == led


def test_the_change_is_bounded() -> None:
    change = FootSeparation().step(command(), leaning(0.4, rate=3.0), SWINGS["right"]).q
    assert change[ROLLS["right"]] == pytest.approx(-FootSeparationConfig().maximum)


def test_nothing_else_is_touched() -> None:
    said = command()
    assert FootSeparation().step(said, leaning(0.2), np.array([False, False])) is said
    assert FootSeparation().step(said, leaning(0.0), SWINGS["left"]) is said
    assert FootSeparation(FootSeparationConfig(minimum=0.0)).step(said, leaning(0.2), SWINGS["left"]) is said
    led = FootSeparation().step(said, leaning(0.2), SWINGS["left"])
    assert not said.q.any()
    assert led.kp is said.kp and led.kd is said.kd and led.tau is said.tau


def test_a_base_layer_without_it_leads_no_foot() -> None:
    layer = Locomotion(Recorder(), LocomotionConfig(foot_separation=None))
    state = leaning(0.2)
    layer.reset(state)
    said = [layer.step(state, still(), Twist(0.3), 0.02).q[list(ROLLS.values())] for _ in range(100)]
    assert not np.any(said)


@pytest.mark.parametrize("on_ground", [False, True])
def test_the_base_layer_leads_the_foot_that_its_clock_swings_unless_it_carries_load(on_ground: bool) -> None:
    """A controller may keep a cadence of its own. The robot of this test does not move, so its feet stay too near."""
    controller = Recorder()
    layer = Locomotion(controller)
    state, base = leaning(0.2), replace(still(), contact=np.full(2, float(on_ground)))
    layer.reset(state)
    swung = {side: 0 for side in SIDES}
    for _ in range(100):
        q = layer.step(state, base, Twist(0.3), 0.02).q
        swings = layer.gait.phases >= layer.gait.config.stance
        led = np.array([bool(q[roll]) for roll in ROLLS.values()])
        assert led.tolist() == (swings & (not on_ground)).tolist()
        for side, swing in zip(SIDES, swings, strict=True):
            swung[side] += int(swing)
    assert min(swung.values()) > 20
