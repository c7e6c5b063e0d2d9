"""The gate's own estimate of balance: who carries the robot, where it would come to rest, what feet say of up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from tests.hardware.conftest import carrying, make_state

from golem.hardware.safety.base import SafetyLimits
from golem.hardware.safety.gate_balance import carried, no_balance, sensed, unbalanced
from golem.interfaces.payloads import Reason
from golem.native import Records
from golem.robots.model.pinocchio_model import build
from golem.types import Array, LowState

LIMITS, DT = SafetyLimits.from_profile(), 0.01
Q, TAU = carrying()


def watched(*states: LowState) -> Records:
    m = sensed(no_balance(), states[0], None, LIMITS)
    for state in states:
        m = sensed(m, state, DT, LIMITS)
    return m


def leaning(angle: float) -> Array:
    return np.array([np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])


def test_a_robot_on_its_feet_is_carried_and_balanced_and_one_in_the_air_is_not_carried() -> None:
    m = watched(*[make_state(0.0, Q, tau=TAU)] * 50)
    assert carried(m) and unbalanced(m) is None
    assert m["feet"]["force"][0] == pytest.approx([324.0, 324.0], rel=0.05)
    hanging = watched(*[make_state(0.0, Q)] * 50)
    assert not carried(hanging) and unbalanced(hanging) is None


def test_its_centre_of_mass_is_that_of_pinocchio() -> None:
    q, model = Q + 0.1 * np.sin(np.arange(27.0)), build()
    com = pin.centerOfMass(model, model.createData(), q)
    np.testing.assert_allclose(watched(make_state(0.0, q))["com"][0], com, atol=0.02)  # hands


def test_who_leans_far_over_is_not_balanced_and_feet_on_the_floor_say_so_of_the_imu() -> None:
    far = watched(*[make_state(0.0, Q, tau=TAU, quat=leaning(0.45))] * 10)
    assert far["outside"][0] > LIMITS.capture[0]
    fault = unbalanced(far)
    assert fault is not None and fault.reason is Reason.BALANCE
    little = [make_state(0.0, Q, tau=TAU, quat=leaning(0.2))] * 60
    assert unbalanced(watched(*little)) is None, "so is a ramp"
    lying = unbalanced(watched(*[make_state(0.0, Q, tau=TAU, quat=leaning(0.3))] * 60))
    assert lying is not None and lying.reason is Reason.IMU_IMPLAUSIBLE


def test_who_sinks_is_not_balanced() -> None:
    def bent(k: int) -> LowState:
        dq = np.zeros(27)
        dq[[1, 7]], dq[[3, 9]], dq[[4, 10]] = -2.0, 4.0, -2.0
        return replace(make_state(0.0, Q + k * DT * dq, tau=TAU), dq=dq)

    landing = watched(*map(bent, range(12)))
    assert landing["sinks"][0] > LIMITS.sinking and unbalanced(landing) is None, "so does who lands from a step"
    fault = unbalanced(watched(*map(bent, range(30))))
    assert fault is not None and fault.reason is Reason.BALANCE and "sinks" in fault.detail


def test_who_has_a_foot_in_the_air_may_be_farther_out_which_a_robot_on_both_feet_may_not() -> None:
    """A shoved robot that walks catches itself with the foot that it puts down: 0.27 m in two robot hours."""
    one_foot = TAU.copy()
    one_foot[6:12] = 0.0  # the right leg bears nothing
    for angle, balanced in ((0.42, True), (0.62, False)):
        m = watched(*[make_state(0.0, Q, tau=one_foot, quat=leaning(angle))] * 10)
        outside = float(m["outside"][0])
        assert (LIMITS.capture[0] < outside < LIMITS.capture[1]) is balanced, outside
        assert (unbalanced(m) is None) is balanced
    both = watched(*[make_state(0.0, Q, tau=TAU, quat=leaning(0.42))] * 10)
    fault = unbalanced(both)
    assert fault is not None and "outside the soles" in fault.detail
