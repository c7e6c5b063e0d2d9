"""An activation and a reset look for themselves; all faults of a tick count; legs that hang or go limp are found."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.hardware.safety.base import OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.interfaces.payloads import EstopMessage, Fault, GateState, Reason
from golem.types import LEGS

Make = Callable[..., Any]
PRESSED = EstopMessage(0.0, 9, True)


def some(size: float, index: int, rest: float = 0.0) -> Any:
    array = np.full(27, rest)
    array[index] = size
    return array


@pytest.mark.parametrize(
    "change",
    [
        {"kd": np.full(27, 1e-6), "kp": np.zeros(27)},
        {"kd": some(0.0, 22, 3.0)},
        {"q": some(1.7, 15)},
        {"tau": some(-70.0, 16)},
    ],
    ids=["limp", "a wrist let go", "far away", "thrown"],
)
def test_what_does_not_hold_the_robot_where_it_is_activates_nothing(
    change: dict[str, Any], bench: Any, command_at: Make
) -> None:
    bench.tick()
    result = bench.tick(command=command_at(bench.t + 0.002, **change), request=OperatorRequest.ACTIVATE)
    assert (result.state, result.reason) == (GateState.ARMED, Reason.COMMAND_AWAY)


@pytest.mark.parametrize("again", [False, True], ids=["a new command", "the command of before"])
def test_whoever_is_activated_holds_on_from_the_first_command(again: bool, bench: Any, command_at: Make) -> None:
    held = command_at(bench.t + 0.002)
    bench.tick(command=held)
    asked = {"command": held} if again else {}
    assert bench.tick(request=OperatorRequest.ACTIVATE, **asked).state is GateState.ACTIVE
    for _ in range(3):
        limp = command_at(bench.t + 0.002, kp=np.zeros(27), kd=np.zeros(27))
        result = bench.tick(command=limp)
    assert (result.state, result.reason) == (GateState.STOP1, Reason.COMMAND_GAINS)


def test_a_reset_waits_a_second_and_for_rest(bench: Any, state_at: Make) -> None:
    bench.activate()
    bench.tick(estop=PRESSED)

    def asked(**changes: Any) -> GateState:
        bench.tick(**changes)
        return bench.tick(request=OperatorRequest.RESET, **changes).state

    assert asked() is GateState.STOP1
    bench.wait(1.0)
    falling = state_at(bench.t + 0.004)
    falling = replace(falling, imu=replace(falling.imu, gyro=np.array([0.0, 1.0, 0.0])))
    assert asked(state=falling) is GateState.STOP1
    assert asked() is GateState.ARMED


def test_reset_and_activation_at_50_hz_never_arm_a_robot_that_falls(bench: Any, state_at: Make) -> None:
    bench.activate()
    bench.tick(estop=PRESSED)
    for k in range(400):
        state = state_at(bench.t + 0.002, dq=np.full(27, 2.0))
        state = replace(state, q=np.full(27, 2e-3 * (k % 2)))
        request = OperatorRequest.RESET if k % 10 == 0 else OperatorRequest.ACTIVATE
        assert bench.tick(state=state, request=request).state.stopped


@pytest.mark.parametrize("first", [True, False])
def test_a_soft_fault_hides_no_hard_one(first: bool, limits: SafetyLimits, bench: Any) -> None:
    soft, hard = Fault(Reason.WRITERS, "two stacks", stands=True), Fault(Reason.MOTOR, "a knee")
    bench.activate()
    result = bench.tick(transport=(soft, hard) if first else (hard, soft))
    assert (result.state, result.reason) == (GateState.STOP1, Reason.MOTOR)


@pytest.fixture
def walking(bench: Any) -> Any:
    """An active gate of a robot on its feet whose legs answer the state; its sensors live."""
    bench.gate = Gate(SafetyLimits.from_profile())
    bench.carry()
    bench.rng = np.random.default_rng(0)
    for k in range(600):
        result = bench.tick(request=OperatorRequest.ACTIVATE if k else OperatorRequest.NONE, **living(bench, k // 10))
    assert result.state is GateState.ACTIVE, result.detail
    return bench


def living(bench: Any, target: float, **gains: Any) -> dict[str, Any]:
    from tests.hardware.conftest import make_command, make_state

    noise, t = bench.rng.standard_normal, bench.t + 0.002
    state = make_state(t, bench.q + 1e-6 * noise(27), dq=1e-4 * noise(27), tau=bench.tau + noise(27))
    imu = replace(state.imu, gyro=1e-3 * noise(3), acc=state.imu.acc + 0.02 * noise(3))
    q = bench.q.copy()
    q[LEGS] += 1e-3 * np.sin(target)
    return {"state": replace(state, imu=imu), "command": make_command(t, q, **gains)}


def stopped(bench: Any, change: Callable[[int], dict[str, Any]], ticks: int) -> tuple[int, Any]:
    for k in range(ticks):
        result = bench.tick(**change(k))
        if result.state is not GateState.ACTIVE:
            return k, result
    return ticks, bench.results[-1]


def test_legs_that_answered_and_then_say_the_same_for_ever_are_found(walking: Any) -> None:
    k, result = stopped(walking, lambda k: living(walking, 60), 200)
    assert result.reason is Reason.COMMAND_HUNG and 45 <= k <= 60


@pytest.mark.parametrize("answers", [True, False])
def test_legs_that_torques_carry_answer_by_these(answers: bool, walking: Any) -> None:
    """A whole-body controller holds a target without stiffness and answers by feed-forward torques."""

    def held(k: int) -> dict[str, Any]:
        return living(walking, 60, kp=np.zeros(27), tau=np.full(27, 8.0 + 0.01 * (answers * k // 10)))

    k, result = stopped(walking, held, 200)
    assert (k, result.reason) == (200, None) if answers else result.reason is Reason.COMMAND_HUNG and 45 <= k <= 60


def test_a_robot_that_hangs_may_hold_its_targets(walking: Any) -> None:
    walking.tau = np.zeros(27)
    assert stopped(walking, lambda k: living(walking, k // 10), 100)[0] == 100
    assert stopped(walking, lambda k: living(walking, 60), 300)[0] == 300


@pytest.mark.parametrize(
    ("gains", "reason"),
    [
        ({"kp": np.zeros(27)}, Reason.COMMAND_GAINS),
        ({"kp": np.full(27, 60.0)}, Reason.COMMAND_GAINS),
        ({"kd": np.full(27, 0.2)}, Reason.COMMAND_GAINS),
        ({"kp": np.zeros(27), "tau": np.full(27, 8.0)}, None),
    ],
    ids=["no stiffness", "little", "no damping", "fed forward"],
)
def test_legs_that_carry_are_held(gains: dict[str, Any], reason: Reason | None, walking: Any) -> None:
    _, result = stopped(walking, lambda k: living(walking, k // 10, **gains), 20)
    assert result.reason is reason


def test_every_state_that_arrives_is_integrated(bench: Any, state_at: Make) -> None:
    """Of a gate that runs at 100 Hz, beside a joint whose position leaves its speed and one that moves."""
    for drifts in (False, True):
        bench = type(bench)(Gate(replace(SafetyLimits.from_profile().still(), dead_time=np.inf)))
        bench.activate()
        found = None
        for k in range(400):
            t, states = bench.t + 0.002, list[Any]()
            for i in range(5):
                s, q, dq = 0.002 * (5 * k + i), np.zeros(27), np.zeros(27)
                q[16], dq[16] = 0.3 * np.sin(8.0 * s), 2.4 * np.cos(8.0 * s)
                q[18] = 0.05 * s if drifts else 0.0
                states.append((1.0 + s, state_at(t, q, dq=dq)))
            newest = states.pop()
            bench.t += 0.008
            result = bench.tick(state=replace(newest[1], t=bench.t + 0.002), tick=newest[0], earlier=tuple(states))
            found = found or result.reason
        assert found is (Reason.STATE_IMPLAUSIBLE if drifts else None)


def test_what_legs_were_told_in_the_air_does_not_count(walking: Any, monkeypatch: Any) -> None:
    """One spoilt sample that looks like a foot on the ground makes no hung policy of legs that rest in a hoist."""
    monkeypatch.setattr("golem.hardware.safety.senses.carried", lambda balance: False)
    k, result = stopped(walking, lambda k: living(walking, 60), 200)
    assert (k, result.reason) == (200, None)
    monkeypatch.undo()
    k, result = stopped(walking, lambda k: living(walking, 60), 200)
    assert result.reason is Reason.COMMAND_HUNG and 30 <= k <= 60
