"""The base layer: which twist a controller gets, when it steps, and how often it runs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.capabilities.legs.recorder import Recorder, crouching, still

from golem.capabilities.legs.balance_errors import VelocityIntegratorConfig
from golem.capabilities.legs.base import Envelope
from golem.capabilities.legs.gait import GaitConfig
from golem.capabilities.legs.locomotion import Locomotion, LocomotionConfig
from golem.errors import ConfigError
from golem.interfaces.payloads import LegCommand
from golem.types import Array, Twist

DT = 0.02
ZERO = Twist()


class Driver:
    """Runs a base layer over a robot that stands still, by default without the correction this would call for."""

    def __init__(self, controller: Recorder, trim: float = 0.0) -> None:
        self.controller, self.state, self.base = controller, crouching(), still()
        self.layer = Locomotion(
            controller, LocomotionConfig(trim=VelocityIntegratorConfig(gain=trim) if trim else None)
        )
        self.layer.reset(self.state)

    def run(self, seconds: float, twist: Twist | None = None, dt: float = DT) -> None:
        """Command `twist` at every tick; None says nothing."""
        for _ in range(round(seconds / dt)):
            self.layer.step(self.state, self.base, twist, dt)

    @property
    def applied(self) -> Twist:
        return self.controller.motions[-1].twist


@pytest.fixture
def driver() -> Driver:
    return Driver(Recorder())


def test_a_twist_inside_the_envelope_is_reached_at_the_allowed_acceleration(driver: Driver) -> None:
    twist = Twist(0.5, -0.2, 0.4)
    driver.run(1.0, twist)
    assert driver.applied == twist
    assert (driver.layer.clamped, driver.layer.reason) == (False, "")
    v = np.array([(m.twist.vx, m.twist.vy, m.twist.wz) for m in driver.controller.motions])
    assert (np.abs(np.diff(v, axis=0)) <= np.array(LocomotionConfig().acceleration) * DT + 1e-12).all()
    assert v[0, 0] == pytest.approx(1.0 * DT)


@pytest.mark.parametrize("huge", [Twist(1e9, 0.0, 0.0), Twist(0.0, -1e300, 5.0)])
def test_a_huge_twist_is_clamped_to_the_envelope_and_reported(driver: Driver, huge: Twist) -> None:
    driver.run(2.0, huge)
    assert driver.applied == driver.controller.envelope.clamp(huge)
    assert driver.layer.clamped
    assert "outside the envelope" in driver.layer.reason
    assert driver.layer.commanded == huge


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("component", ["vx", "vy", "wz"])
def test_a_twist_that_is_not_finite_stops_the_robot_and_is_reported(driver: Driver, bad: float, component: str) -> None:
    driver.run(1.0, Twist(0.5))
    driver.run(1.0, replace(Twist(0.5), **{component: bad}))
    assert driver.applied == ZERO
    assert "not finite" in driver.layer.reason


def test_below_the_dead_band_the_twist_is_exactly_zero(driver: Driver) -> None:
    driver.run(1.0, Twist(0.06, 0.05, 0.05))
    assert {m.twist for m in driver.controller.motions} == {ZERO}
    assert "dead band" in driver.layer.reason
    driver.run(1.0, Twist(0.08, 0.05, 0.05))
    assert driver.applied == Twist(0.08, 0.05, 0.05)


def test_a_stop_ends_exactly_at_zero(driver: Driver) -> None:
    driver.run(1.0, Twist(0.5, 0.1, 0.3))
    driver.run(0.6, ZERO)
    assert driver.applied == ZERO
    assert driver.layer.reason == ""


def test_a_stream_that_ends_stops_the_robot_after_half_a_second(driver: Driver) -> None:
    driver.run(1.0, Twist(0.5))
    driver.run(0.48)
    assert driver.applied == Twist(0.5)
    driver.run(0.6)
    assert driver.applied == ZERO
    assert "no twist came for 0.5 s" in driver.layer.reason


def test_nobody_walks_before_the_estimate_has_found_the_floor(driver: Driver) -> None:
    found = driver.base
    driver.base = replace(found, stale=True)
    driver.run(1.0, Twist(0.5))
    assert driver.applied == ZERO
    assert driver.layer.reason == "the base estimate has not found the floor yet"
    driver.base = found
    driver.run(1.0, Twist(0.5))
    assert driver.applied == Twist(0.5)
    driver.base = replace(found, stale=True)  # lost for a moment, as in a shove: how long is the gate's business
    driver.run(0.1, Twist(0.5))
    assert driver.applied == Twist(0.5)
    driver.layer.reset(driver.state)
    driver.run(1.0, Twist(0.5))
    assert driver.applied == ZERO


def test_a_twist_from_before_a_reset_is_void(driver: Driver) -> None:
    driver.run(1.0, Twist(0.5))
    driver.layer.reset(driver.state)
    driver.run(0.1)
    assert driver.applied == ZERO
    assert not driver.controller.motions[-1].stepping


def test_a_commanded_robot_steps_until_it_stands(driver: Driver) -> None:
    driver.run(0.5)
    assert not any(m.stepping for m in driver.controller.motions)
    driver.run(2.0, Twist(0.5))
    walking = driver.controller.motions[-50:]
    assert all(m.stepping for m in walking)
    phases = np.array([m.phase for m in walking])
    np.testing.assert_allclose((phases[:, 1] - phases[:, 0]) % 1.0, 0.5, atol=1e-9)
    np.testing.assert_allclose(np.diff(phases[:, 0]) % 1.0, DT / driver.controller.gait.period, atol=1e-9)
    driver.run(2.0, ZERO)
    last = driver.controller.motions[-1]
    assert not last.stepping
    assert last.twist == ZERO


@pytest.mark.parametrize(
    ("velocity", "gyro", "steps"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), False),
        ((0.2, 0.0, 0.0), (0.0, 0.0, 0.0), False),
        ((0.5, 0.0, 0.0), (0.0, 0.0, 0.0), True),
        ((0.0, 0.4, 0.0), (0.0, 0.0, 0.0), False),
        ((0.0, 0.6, 0.0), (0.0, 0.0, 0.0), True),
        # The CoM lies below base_link: a base that pitches forward swings it back, one that moves on brings it ahead.
        ((0.4, 0.0, 0.0), (0.0, 3.0, 0.0), False),
        ((0.4, 0.0, 0.0), (0.0, -3.0, 0.0), True),
    ],
)
def test_a_standing_robot_steps_when_its_capture_point_leaves_its_feet(
    driver: Driver, velocity: tuple[float, ...], gyro: tuple[float, ...], steps: bool
) -> None:
    driver.base = replace(driver.base, velocity=np.array(velocity))
    driver.state = replace(driver.state, imu=replace(driver.state.imu, gyro=np.array(gyro)))
    driver.run(DT)
    assert driver.controller.motions[-1].stepping is steps


def test_the_gate_turns_with_the_robot(driver: Driver) -> None:
    """A velocity towards the left of a robot that looks along -y makes it lift its right foot at once."""
    T = np.eye(4)
    T[:2, :2] = [[0.0, 1.0], [-1.0, 0.0]]
    driver.base = replace(driver.base, T_odom_base=T, velocity=np.array([0.6, 0.0, 0.0]))
    driver.run(DT)
    np.testing.assert_allclose(driver.controller.motions[-1].phase, [0.05, 0.55], atol=1e-9)
    driver.layer.reset(driver.state)
    driver.base = replace(driver.base, velocity=np.array([-0.6, 0.0, 0.0]))
    driver.run(DT)
    np.testing.assert_allclose(driver.controller.motions[-1].phase, [0.55, 0.05], atol=1e-9)


def test_feet_that_stand_wrongly_make_it_step(driver: Driver) -> None:
    q: Array = driver.state.q.copy()
    q[2], q[8] = 0.15, -0.15
    driver.state = replace(driver.state, q=q)
    driver.run(DT)
    assert driver.controller.motions[-1].stepping


def test_the_waist_is_not_the_pelvis(driver: Driver) -> None:
    """A waist that swings turns the gyro with it, but not the base: nothing there shall look like a fall."""
    q, dq = driver.state.q.copy(), np.zeros(27)
    q[12], dq[12] = 0.6, 8.0
    imu = replace(driver.state.imu, gyro=np.array([0.0, 0.0, 8.0]))
    driver.state = replace(driver.state, q=q, dq=dq, imu=imu)
    driver.run(0.2)
    assert not any(m.stepping for m in driver.controller.motions)


def test_a_controller_that_changes_its_gait_gets_it(driver: Driver) -> None:
    driver.run(1.0, Twist(0.5))
    driver.controller.gait = GaitConfig(period=1.4)
    driver.run(0.1, Twist(0.5))
    phases = [m.phase[0] for m in driver.controller.motions[-2:]]
    assert (phases[1] - phases[0]) % 1.0 == pytest.approx(DT / 1.4)


def test_no_blend_lets_the_next_controller_speak_at_once(driver: Driver) -> None:
    layer = Locomotion(driver.controller, LocomotionConfig(blend=None, foot_separation=None))
    layer.reset(driver.state)
    layer.step(driver.state, driver.base, None, DT)
    layer.hand_over(Recorder(), driver.state, LegCommand(np.ones(12), np.ones(12), np.ones(12)))
    assert layer.step(driver.state, driver.base, None, DT).q[0] != pytest.approx(1.0, abs=0.5)


@given(rate=st.sampled_from([50.0, 100.0, 200.0, 500.0]), loop=st.sampled_from([100.0, 200.0, 500.0]))
def test_a_controller_runs_at_its_own_rate_in_a_faster_loop(rate: float, loop: float) -> None:
    rate = min(rate, loop)
    controller = Recorder(rate)
    layer = Locomotion(controller)
    state, base = crouching(), still()
    layer.reset(state)
    for _ in range(round(0.5 * loop)):
        layer.step(state, base, Twist(0.5), 1.0 / loop)
    assert len(controller.steps) == pytest.approx(0.5 * rate, abs=1)
    np.testing.assert_allclose(controller.steps[1:], 1.0 / rate, atol=1.0 / loop + 1e-9)
    # The phase keeps the controller's period whatever the rates.
    assert sum(controller.steps) == pytest.approx(0.5, abs=1.0 / rate + 1e-9)


def test_after_a_hand_over_the_clock_goes_on_and_the_twist_is_zero(driver: Driver) -> None:
    driver.run(1.0, Twist(0.5))
    before = driver.controller.motions[-1].phase[0]
    other = Recorder(envelope=Envelope((-0.1, 0.1), (0.0, 0.0), (0.0, 0.0)))
    driver.layer.hand_over(other, driver.state, None)
    driver.run(DT)
    assert other.resets == 1
    first = other.motions[0]
    assert first.twist == ZERO
    assert first.stepping
    assert (first.phase[0] - before) % 1.0 == pytest.approx(DT / other.gait.period)


@pytest.mark.parametrize("how", [Twist(0.05), None], ids=["at rest", "silent"])
def test_after_a_hand_over_whoever_commands_has_to_let_go_first(driver: Driver, how: Twist | None) -> None:
    driver.run(1.0, Twist(0.5))
    other = Recorder(envelope=Envelope((-0.1, 0.1), (0.0, 0.0), (0.0, 0.0)))
    driver.layer.hand_over(other, driver.state, None)
    driver.run(3.0, Twist(0.5))
    assert driver.layer.applied == ZERO and "has not let go" in driver.layer.reason
    driver.run(DT if how is not None else 0.6, how)
    driver.run(1.0, Twist(0.5))
    assert driver.layer.applied == other.motions[-1].twist == Twist(0.1)


def test_after_a_hand_over_the_targets_do_not_jump(driver: Driver) -> None:
    last = driver.layer.step(driver.state, driver.base, None, DT)
    driver.layer.hand_over(Recorder(target=1.0, stiffness=200.0), driver.state, last)
    commands = [driver.layer.step(driver.state, driver.base, None, DT) for _ in range(10)]
    q, kp = np.array([(c.q[0], c.kp[0]) for c in commands]).T
    np.testing.assert_allclose(q[:7], np.arange(1, 8) * DT / (LocomotionConfig().blend or 0.0))
    np.testing.assert_allclose(kp, 100.0 + 100.0 * q)
    np.testing.assert_array_equal(q[7:], 1.0)


def test_a_robot_that_lags_is_asked_for_more_within_bounds_and_for_nothing_when_it_shall_stand() -> None:
    driver = Driver(Recorder(), trim=0.5)
    driver.run(6.0, Twist(0.5, 0.0, 0.0))
    maximum = VelocityIntegratorConfig().maximum[0]
    assert driver.applied == Twist(0.5 + maximum, 0.0, 0.0)
    assert driver.layer.applied == Twist(0.5, 0.0, 0.0)
    driver.run(1.0, ZERO)
    assert driver.applied == ZERO
    driver.run(0.6, Twist(0.5, 0.0, 0.0))
    assert driver.applied.vx < 0.5 + maximum  # begun anew


def test_a_component_that_the_controller_does_not_have_is_not_asked_for() -> None:
    driver = Driver(Recorder(envelope=Envelope((0.0, 0.8), (0.0, 0.0), (0.0, 0.0))), trim=0.5)
    driver.base = replace(still(), velocity=np.array([0.0, 0.1, 0.0]))  # it drifts
    driver.run(3.0, Twist(0.5))
    assert driver.applied.vx > 0.5 and (driver.applied.vy, driver.applied.wz) == (0.0, 0.0)


@pytest.mark.parametrize("start", ["never", "command", "balance", "recovery", "always"])
def test_moving_is_what_the_robot_does_whatever_its_clock(start: Any) -> None:
    driver = Driver(Recorder(gait=GaitConfig(start=start)))
    driver.run(0.2)
    assert not driver.layer.moving
    driver.run(0.5, Twist(0.5))
    assert driver.layer.moving
    driver.run(3.0, Twist())
    assert not driver.layer.moving
    assert bool(driver.layer.gait.stepping) == (start == "always")


@pytest.mark.parametrize("changes", [{"vx": (0.2, 0.8)}, {"wz": (-math.inf, 1.0)}, {"vy": (0.1, -0.1)}])
def test_an_envelope_without_zero_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=f"envelope.{next(iter(changes))} is a range around zero"):
        Envelope(**changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"period": 0.0},
        {"stance": 0.5},
        {"capture_start": (-0.1, 0.15)},
        {"capture_stop": 0.0},
        {"feet_start": -1.0},
        {"patience": -1.0},
    ],
)
def test_a_clock_that_cannot_be_meant_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ConfigError, match=r"The gait\."):
        GaitConfig(**changes)


LOW = Envelope((-0.4, 0.8), (-0.3, 0.3), (-0.6, 0.6), (0.78, 0.96, 1.0))


def test_a_height_is_reached_at_the_allowed_speed_held_and_taken_back() -> None:
    driver = Driver(Recorder(envelope=LOW))
    driver.run(0.1)
    driver.run(DT, Twist(height=0.8))
    driver.run(4.0)  # long after the twist has timed out
    heights = np.array([m.height for m in driver.controller.motions[5:]], float)
    assert heights[-1] == 0.8 and driver.layer.reason == ""
    assert np.abs(np.diff(np.r_[0.96, heights])).max() == pytest.approx(LocomotionConfig().height_speed * DT)
    assert driver.applied == ZERO and driver.layer.applied == ZERO
    driver.run(DT, Twist(height=math.nan))
    driver.run(4.0)
    assert driver.controller.motions[-1].height is None


@pytest.mark.parametrize(("asked", "given"), [(0.5, 0.78), (-math.inf, 0.78), (math.inf, 1.0)])
def test_a_height_outside_of_the_range_is_clamped_and_reported(asked: float, given: float) -> None:
    driver = Driver(Recorder(envelope=LOW))
    driver.run(4.0, Twist(height=asked))
    assert driver.controller.motions[-1].height == given
    assert "height is outside of 0.78 to 1 m" in driver.layer.reason


def test_legs_that_take_no_height_say_so(driver: Driver) -> None:
    driver.run(1.0, Twist(0.3, height=0.8))
    assert driver.controller.motions[-1].height is None and driver.applied.vx > 0.2
    assert driver.layer.reason == "the legs take no height and keep their own"
    driver.run(1.0, Twist(0.3))
    assert driver.layer.reason == ""


def test_legs_may_walk_at_a_height_and_a_reset_forgets_it() -> None:
    driver = Driver(Recorder(envelope=LOW))
    driver.run(4.0, Twist(0.3, height=0.8))
    last = driver.controller.motions[-1]
    assert (last.twist, last.height, last.commanded) == (Twist(0.3), 0.8, True)
    driver.layer.reset(driver.state)
    driver.run(DT)
    assert driver.controller.motions[-1].height is None


@pytest.mark.parametrize("heights", [(0.7, 0.96, 1.0), (0.8, 0.7, 1.0), (0.8, 0.96, 1.1), (math.nan, 0.9, 1.0)])
def test_heights_that_no_legs_have_are_refused(heights: tuple[float, float, float]) -> None:
    with pytest.raises(ConfigError, match="from 0.75 to 1.03 m"):
        Envelope(height=heights)
