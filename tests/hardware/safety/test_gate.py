from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import check
from golem.hardware.safety.memory import GateMemory
from golem.interfaces.payloads import EstopMessage, GateState, Reason
from golem.types import LowCommand, LowState

Make = Callable[..., Any]


def limp(command: LowCommand) -> bool:
    return not (command.kp.any() or command.kd.any() or command.tau.any())


def damps(command: LowCommand) -> bool:
    return not (command.kp.any() or command.tau.any() or command.dq.any()) and bool(np.all(command.kd > 0))


def test_a_gate_that_has_seen_nothing_is_limp_and_says_what_is_missing(limits: SafetyLimits) -> None:
    result = check(GateInputs(0.0), limits, GateMemory())
    assert (result.state, result.reason) == (GateState.INIT, Reason.ESTOP_MISSING)
    assert limp(result.command)


def test_no_estop_frame_ever_means_no_motion(bench: Any) -> None:
    for i in range(100):
        result = bench.tick(estop=None, request=(OperatorRequest.NONE, OperatorRequest.ACTIVATE)[i % 2])
        assert (result.state, result.reason) == (GateState.INIT, Reason.ESTOP_MISSING)


def test_sound_frames_arm_and_only_a_request_activates(bench: Any) -> None:
    for _ in range(50):
        result = bench.tick()
    assert result.state is GateState.ARMED
    assert damps(result.command)
    assert bench.tick(request=OperatorRequest.ACTIVATE).state is GateState.ACTIVE


def test_activation_needs_a_command(bench: Any) -> None:
    result = bench.tick(command=None, request=OperatorRequest.ACTIVATE)
    assert (result.state, result.reason) == (GateState.ARMED, Reason.COMMAND_MISSING)
    # The request that failed is spent: motion must not start by itself when a command appears.
    assert bench.tick(request=OperatorRequest.ACTIVATE).state is GateState.ARMED


def test_an_active_gate_passes_the_command(bench: Any) -> None:
    bench.activate()
    for _ in range(200):
        result = bench.tick()
    np.testing.assert_allclose(result.command.kp, 100.0)
    np.testing.assert_allclose(result.command.kd, 3.0)


def test_activation_starts_from_the_measured_position_without_stiffness(bench: Any, state_at: Make) -> None:
    q = np.full(27, 0.1)
    q[[5, 11]] = 0.0
    result = bench.tick(state=state_at(0.0, q), request=OperatorRequest.ACTIVATE)
    assert result.state is GateState.ACTIVE
    assert np.all(np.abs(result.command.q - q) <= 0.1 * 21 * 0.9)
    assert np.all(result.command.kp <= bench.gate.limits.kp_rate * bench.gate.limits.longest_tick)


FAULTS: dict[Reason, Callable[[Any, Make, Make], dict[str, object]]] = {
    Reason.REQUESTED: lambda b, s, c: {"request": OperatorRequest.STOP},
    Reason.CLOCK: lambda b, s, c: {"t": b.t - 1.0},
    Reason.ESTOP_PRESSED: lambda b, s, c: {"estop": EstopMessage(b.t, 999, True)},
    Reason.ESTOP_TIME: lambda b, s, c: {"estop": EstopMessage(b.t + 1.0, 999, False)},
    Reason.STATE_TIME: lambda b, s, c: {"state": s(b.t + 1.0)},
    Reason.STATE_INVALID: lambda b, s, c: {"state": s(b.t + 0.002, np.full(27, np.nan))},
    Reason.VELOCITY: lambda b, s, c: {"state": s(b.t + 0.002, dq=np.full(27, 500.0))},
    Reason.COMMAND_TIME: lambda b, s, c: {"command": c(b.t + 1.0)},
    Reason.COMMAND_INVALID: lambda b, s, c: {"command": c(b.t + 0.002, np.full(27, np.nan))},
}


@pytest.mark.parametrize("reason", FAULTS)
def test_a_fault_stops_at_once_latched_with_its_name(
    reason: Reason, bench: Any, state_at: Make, command_at: Make
) -> None:
    bench.activate()
    result = bench.tick(**FAULTS[reason](bench, state_at, command_at))
    assert (result.state, result.reason) == (GateState.STOP1, reason)
    assert damps(result.command)
    for _ in range(100):
        result = bench.tick()
        assert (result.state, result.reason) == (GateState.STOP1, reason)


@pytest.mark.parametrize(
    ("silent", "reason", "age"),
    [
        ("estop", Reason.ESTOP_STALE, "estop_age"),
        ("state", Reason.STATE_STALE, "state_age"),
        ("command", Reason.COMMAND_STALE, "command_age"),
    ],
)
@pytest.mark.parametrize("how", ["dropped", "repeated", "reordered", "delayed"])
def test_silence_stops_within_the_age_however_it_looks(
    silent: str, reason: Reason, age: str, how: str, bench: Any, state_at: Make, command_at: Make
) -> None:
    make = {"estop": lambda t: EstopMessage(t, round(t / 0.002), False), "state": state_at, "command": command_at}[
        silent
    ]
    bench.activate()
    for _ in range(20):
        bench.tick()
    last = bench.t
    frames = {
        "dropped": lambda t: None,
        "repeated": lambda t: make(last),
        "reordered": lambda t: make(last - (t - last)),
        "delayed": lambda t: make(t - 0.2),
    }
    for _ in range(200):
        result = bench.tick(**{silent: frames[how](bench.t)})
        if result.state is not GateState.ACTIVE:
            break
    assert (result.state, result.reason) == (GateState.STOP1, reason)
    assert bench.t - last == pytest.approx(getattr(bench.gate.limits, age), abs=0.0021)


def test_an_estop_board_that_repeats_its_sequence_is_dead(bench: Any) -> None:
    bench.activate()
    for _ in range(30):
        result = bench.tick(estop=EstopMessage(bench.t + 0.002, 1, False))
    assert (result.state, result.reason) == (GateState.STOP1, Reason.ESTOP_STALE)


def test_short_gaps_and_late_duplicates_do_not_stop(bench: Any, state_at: Make, command_at: Make) -> None:
    bench.activate()
    for i in range(500):
        old = bench.t - 0.01
        changes: dict[str, object] = {}
        if i % 20 in range(10):
            changes = {"state": state_at(old), "command": command_at(old), "estop": None}
        assert bench.tick(**changes).state is GateState.ACTIVE


def test_a_pressed_button_stays_pressed_until_a_frame_says_otherwise(bench: Any) -> None:
    bench.tick(estop=EstopMessage(bench.t, 999, True))
    for _ in range(5):
        result = bench.tick(estop=None)
        assert (result.state, result.reason) == (GateState.INIT, Reason.ESTOP_PRESSED)
    assert bench.tick().state is GateState.ARMED


def test_a_late_pressed_frame_counts(bench: Any) -> None:
    bench.activate()
    for _ in range(20):
        bench.tick()
    result = bench.tick(estop=EstopMessage(bench.t - 0.02, 3, True))
    assert result.reason is Reason.ESTOP_PRESSED


def test_damping_ends_limp(bench: Any) -> None:
    bench.activate()
    states = [bench.tick(request=OperatorRequest.STOP).state]
    start = bench.t
    while states[-1] is GateState.STOP1:
        states.append(bench.tick().state)
    assert states[-1] is GateState.STOP0
    assert bench.t - start == pytest.approx(bench.gate.limits.damping_time, abs=0.003)
    assert limp(bench.results[-1].command)
    assert bench.results[-1].reason is Reason.REQUESTED


def test_a_stop_is_latched_before_the_activation_too(bench: Any) -> None:
    assert bench.tick().state is GateState.ARMED
    result = bench.tick(request=OperatorRequest.STOP)
    assert (result.state, result.reason) == (GateState.STOP1, Reason.REQUESTED)
    assert bench.tick(request=OperatorRequest.ACTIVATE).state is GateState.STOP1
    bench.wait(1.1)
    assert bench.tick(request=OperatorRequest.RESET).state is GateState.ARMED
    assert bench.tick(request=OperatorRequest.ACTIVATE).state is GateState.ACTIVE


def test_reset_needs_the_button_out_and_a_request_and_does_not_restart(bench: Any) -> None:
    bench.activate()
    bench.tick(estop=EstopMessage(bench.t, 999, True))
    pressed = bench.tick(estop=EstopMessage(bench.t + 0.002, 1000, True), request=OperatorRequest.RESET)
    assert pressed.state is GateState.STOP1
    assert bench.wait(1.0, request=OperatorRequest.RESET).state is GateState.STOP1
    # Released, and the request still held: it must be made anew.
    assert bench.tick(request=OperatorRequest.RESET).state is GateState.STOP1
    assert bench.tick(request=OperatorRequest.ACTIVATE).state is GateState.STOP1
    assert bench.tick().state is GateState.STOP1
    result = bench.tick(request=OperatorRequest.RESET)
    assert (result.state, result.reason) == (GateState.ARMED, None)
    for _ in range(100):
        assert bench.tick(request=OperatorRequest.RESET).state is GateState.ARMED
    result = bench.tick(request=OperatorRequest.ACTIVATE)
    assert result.state is GateState.ACTIVE
    assert np.all(result.command.kp <= bench.gate.limits.kp_rate * 0.0021)


@pytest.mark.parametrize("stuck", [OperatorRequest.ACTIVATE, OperatorRequest.RESET])
def test_a_stuck_request_restarts_nothing(stuck: OperatorRequest, bench: Any) -> None:
    bench.activate()
    bench.tick(request=stuck)
    bench.tick(estop=EstopMessage(bench.t, 999, True), request=stuck)
    for _ in range(100):
        assert bench.tick(request=stuck).state is GateState.STOP1


def test_releasing_the_button_before_activation_starts_nothing(bench: Any) -> None:
    bench.tick()
    assert bench.tick(estop=EstopMessage(bench.t, 999, True), request=OperatorRequest.ACTIVATE).state is GateState.INIT
    for _ in range(100):
        assert bench.tick(request=OperatorRequest.ACTIVATE).state is GateState.ARMED


def test_a_short_pause_allows_no_leap(bench: Any, command_at: Make, limits: SafetyLimits) -> None:
    bench.activate()
    before = bench.tick().command.q
    bench.t += limits.stall - 0.01
    t = bench.t + 0.002
    result = bench.tick(command=command_at(t, limits.upper.copy()))
    assert result.state is GateState.ACTIVE
    assert np.all(np.abs(result.command.q - before) <= limits.slew * limits.longest_tick + 1e-12)


def test_after_a_pause_the_robot_is_damped_however_fresh_everything_looks(
    bench: Any, state_at: Make, limits: SafetyLimits
) -> None:
    bench.activate()
    for _ in range(100):
        bench.tick()
    bench.t += limits.stall
    result = bench.tick(state=state_at(bench.t + 0.002, np.full(27, 0.02)))
    assert (result.state, result.reason) == (GateState.STOP1, Reason.STALLED)
    assert damps(result.command)


def test_check_is_pure(bench: Any, limits: SafetyLimits, state_at: Make, command_at: Make) -> None:
    bench.activate()
    memory = bench.gate.memory
    t = bench.t + 0.002
    state, command = state_at(t, np.full(27, 0.01)), command_at(t, np.full(27, 0.05))
    inputs = GateInputs(t, state, command)
    arrays = (memory.outgoing.q, memory.outgoing.kp, command.q, state.q)
    kept = [array.copy() for array in arrays]
    a, b = check(inputs, limits, memory), check(inputs, limits, memory)
    np.testing.assert_array_equal(a.command.q, b.command.q)
    for was, array in zip(kept, arrays, strict=True):
        np.testing.assert_array_equal(was, array)
    assert memory.t == bench.t


def test_single_precision_frames_from_the_wire_are_fine(bench: Any, state_at: Make, command_at: Make) -> None:
    def single(frame: LowState | LowCommand) -> Any:
        names = ("q", "dq", "tau", *(("kp", "kd") if isinstance(frame, LowCommand) else ()))
        return replace(frame, **{n: getattr(frame, n).astype(np.float32) for n in names})

    for i in range(10):
        t = bench.t + 0.002
        result = bench.tick(
            state=single(state_at(t)),
            command=single(command_at(t)),
            request=OperatorRequest.ACTIVATE if i else OperatorRequest.NONE,
        )
    assert result.state is GateState.ACTIVE
    assert result.command.q.dtype == np.float64
