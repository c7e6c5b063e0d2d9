"""A stop that leaves state and legs sound gives the legs to a controller that stands; any other damps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from golem.errors import GolemError
from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.standing_gate import StandingGate
from golem.interfaces.payloads import EstopMessage, Fault, GateState, Reason
from golem.types import LEGS, UPPER, Array, BaseEstimate, LowCommand, LowState

Make = Callable[..., Any]


class Stands:
    """Stands where the robot is; fails on demand."""

    failing: Exception | None = None
    stiffness = 200.0
    knee = 0.0
    refusing: Exception | None = None

    def start(self, state: LowState) -> None:
        if self.refusing:
            raise self.refusing
        self.started = state

    def step(self, state: LowState, damping: Array) -> LowCommand:
        if self.failing:
            raise self.failing
        kp = np.zeros(27)
        kp[LEGS] = self.stiffness
        tau = np.zeros(27)
        tau[3] = self.knee
        return LowCommand(state.t, state.q, np.zeros(27), tau, kp, damping)


@pytest.fixture
def legs() -> Stands:
    return Stands()


@pytest.fixture
def standing(bench: Any, limits: SafetyLimits, legs: Stands) -> Any:
    """A bench whose active gate can stand, with feet on the ground."""
    bench.gate = StandingGate(Gate(limits), lambda: legs)
    bench.carry()
    bench.activate()
    for _ in range(100):
        bench.tick(base=BaseEstimate(bench.t + 0.002, np.eye(4)))
    assert bench.results[-1].state is GateState.ACTIVE
    return bench


def nan(command_at: Make, t: float) -> LowCommand:
    return command_at(t, np.full(27, np.nan))


def test_a_fault_of_the_sender_leaves_the_robot_standing(standing: Any, command_at: Make) -> None:
    result = standing.tick(command=nan(command_at, standing.t + 0.002))
    assert (result.state, result.reason) == (GateState.STOP2, Reason.COMMAND_INVALID)
    for _ in range(300):
        result = standing.tick(command=None)
    assert result.state is GateState.STOP2
    assert (result.command.kp[LEGS] > 50.0).all(), "the legs stay stiff"
    assert not result.command.kp[UPPER].any() and (result.command.kd[UPPER] > 0.0).all()


def test_legs_keep_their_stiffness_at_the_take_over(standing: Any, command_at: Make) -> None:
    before = standing.results[-1].command.kp[LEGS]
    standing.tick(command=nan(command_at, standing.t + 0.002))
    after = standing.tick(command=None).command.kp[LEGS]
    assert (after >= before).all()


@pytest.mark.parametrize(
    "change",
    [
        lambda b, s: {"estop": EstopMessage(b.t, 999, True)},
        lambda b, s: {"state": s(b.t + 0.002, np.full(27, np.nan))},
        lambda b, s: {"request": OperatorRequest.STOP},
        lambda b, s: {"transport": (Fault(Reason.WRITERS, "two robots"),)},
    ],
)
@pytest.mark.parametrize("first", [True, False])
def test_what_makes_standing_impossible_damps(
    standing: Any, change: Any, first: bool, state_at: Make, command_at: Make
) -> None:
    if not first:
        standing.tick(command=nan(command_at, standing.t + 0.002))
        assert standing.tick(command=None).state is GateState.STOP2
    result = standing.tick(**change(standing, state_at))
    assert result.state is GateState.STOP1
    assert not result.command.kp.any() and (result.command.kd > 0.0).all()


def test_a_gate_that_stood_and_was_held_up_damps(standing: Any, limits: SafetyLimits, command_at: Make) -> None:
    standing.tick(command=nan(command_at, standing.t + 0.002))
    assert standing.tick(command=None).state is GateState.STOP2
    standing.t += limits.stall - 0.01
    assert standing.tick(command=None).state is GateState.STOP2
    standing.t += limits.stall
    result = standing.tick(command=None)
    assert (result.state, result.reason) == (GateState.STOP1, Reason.STALLED)


def test_a_fault_of_the_arms_leaves_it_standing_and_one_of_the_legs_does_not(standing: Any, state_at: Make) -> None:
    for joint, state in ((16, GateState.STOP2), (3, GateState.STOP1)):
        standing.gate.gate.memory = standing.results[-1].memory
        dq = np.zeros(27)
        dq[joint] = 500.0
        result = standing.tick(
            state=state_at(standing.t + 0.002, standing.q, dq=dq, tau=standing.tau),
            base=BaseEstimate(standing.t, np.eye(4)),
        )
        assert (result.state, result.reason) == (state, Reason.VELOCITY)
        standing.results.pop()


def test_without_a_foot_on_the_ground_nobody_stands(
    bench: Any, limits: SafetyLimits, legs: Stands, command_at: Make
) -> None:
    bench.gate = StandingGate(Gate(limits), lambda: legs)
    bench.activate()
    assert bench.tick(command=nan(command_at, bench.t + 0.002)).state is GateState.STOP1


@pytest.mark.parametrize(
    "fails",
    [
        {"failing": GolemError("no network")},
        {"failing": ZeroDivisionError()},
        {"stiffness": np.nan},
        {"stiffness": 1.0},
    ],
)
def test_a_standing_controller_that_fails_damps_and_is_named(
    fails: dict[str, Any], standing: Any, legs: Stands, command_at: Make
) -> None:
    standing.tick(command=nan(command_at, standing.t + 0.002))
    vars(legs).update(fails)
    result = standing.wait(0.02, command=None)
    assert (result.state, result.reason) == (GateState.STOP1, Reason.STANDING)


def test_a_standing_controller_that_does_not_start_is_not_asked_to_step(
    standing: Any, legs: Stands, command_at: Make
) -> None:
    legs.refusing = GolemError("no posture to start from")
    standing.tick(command=nan(command_at, standing.t + 0.002))
    result = standing.wait(0.02, command=None)
    assert (result.state, result.reason) == (GateState.STOP1, Reason.STANDING)


def test_in_stop2_a_motor_without_torque_is_named_and_an_outlier_is_borne(
    standing: Any, legs: Stands, state_at: Make, command_at: Make
) -> None:
    def knee(q: float, tau: float) -> LowState:
        state = state_at(standing.t + 0.002, standing.q.copy(), tau=standing.tau.copy())
        state.q[3] += q
        state.tau[3] *= tau
        return state

    standing.tick(command=nan(command_at, standing.t + 0.002))
    for k in range(300):
        result = standing.tick(command=None, state=knee(0.5 if k % 60 == 0 else 0.0, 1.0))
    assert result.state is GateState.STOP2
    legs.knee = 60.0
    for _ in range(120):
        result = standing.tick(command=None, state=knee(0.0, 0.0))
    assert (result.state, result.reason) == (GateState.STOP1, Reason.MOTOR_DEAD)


def test_a_robot_that_stands_goes_on_after_reset_and_activation_and_not_before(standing: Any, command_at: Make) -> None:
    standing.tick(command=nan(command_at, standing.t + 0.002))
    standing.tick()
    assert standing.tick(request=OperatorRequest.ACTIVATE).state is GateState.STOP2, "the reason still stands"
    assert standing.tick(request=OperatorRequest.RESET).reason is not None, "so soon nothing is reset"
    standing.wait(1.0)
    result = standing.tick(request=OperatorRequest.RESET)
    assert (result.state, result.reason) == (GateState.STOP2, None)
    standing.tick()
    assert standing.tick(request=OperatorRequest.ACTIVATE).state is GateState.ACTIVE
