"""The gate's compiled tick against the readable gate: the same commands and memory, and only ordinary ticks."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from golem.capabilities.legs.hold import STANCES
from golem.hardware.safety.base import GateInputs, OperatorRequest, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.gate_stage import GateStage
from golem.hardware.safety.memory import GateMemory
from golem.interfaces.payloads import EstopMessage, GateState
from golem.native import ORDINARY, UNUSUAL, new_shared
from golem.native_messages import command_of, put_command, put_state
from golem.types import LEGS, NUM_JOINTS, TICK, BaseEstimate, Imu, LowCommand, LowState

LIMITS = SafetyLimits.from_profile()


class Bench:
    """A robot that stands and sways a little under commands that follow it, with the noise of real sensors."""

    def __init__(self) -> None:
        self.rng = np.random.default_rng(0)
        self.gate, self.ticks = Gate(LIMITS), 0
        self.q = np.zeros(NUM_JOINTS)
        self.q[LEGS] = np.tile(STANCES["crouch"], 2)

    def inputs(self) -> GateInputs:
        t, rng = self.ticks * TICK, self.rng
        sway = 0.02 * math.sin(3.0 * t)
        q = self.q + sway + 1e-6 * rng.standard_normal(NUM_JOINTS)
        dq = 0.06 * math.cos(3.0 * t) + 1e-4 * rng.standard_normal(NUM_JOINTS)
        imu = Imu(
            np.array([1.0, 0.0, 0.0, 0.0]) + 1e-5 * rng.standard_normal(4),
            1e-3 * rng.standard_normal(3),
            np.array([0.0, 0.0, 9.81]) + 0.03 * rng.standard_normal(3),
        )
        state = LowState(t, q, dq, rng.standard_normal(NUM_JOINTS), imu)
        gains = np.full(NUM_JOINTS, 150.0), np.full(NUM_JOINTS, 4.0)
        target = self.q + 0.05 * np.sin(t + np.arange(NUM_JOINTS))
        command = LowCommand(t, target, np.zeros(NUM_JOINTS), np.sin(3.0 * t + self.q), *gains)
        frame = self.ticks // 5
        estop = EstopMessage(5 * frame * TICK, frame % 256, False)
        base = BaseEstimate(t, np.eye(4), stale=self.ticks % 50 > 40)
        self.ticks += 1
        return GateInputs(t, state, command, estop, OperatorRequest.ACTIVATE, base)

    def activate(self) -> GateStage:
        """Run the gate until the stage takes over."""
        stage = GateStage(LIMITS)
        for _ in range(200):
            inputs = self.inputs()
            waits = self.gate.memory.mode is GateState.INIT
            self.gate.step(replace(inputs, request=OperatorRequest.NONE) if waits else inputs)
        assert stage.take(self.gate.memory)
        return stage


def put(record: Any, inputs: GateInputs) -> None:
    state, command, estop, base = inputs.state, inputs.command, inputs.estop, inputs.base
    assert state is not None and command is not None and estop is not None and base is not None
    record["t"] = inputs.t
    put_state(record, state)
    put_command(record["request"][0], command)
    record["request_t"] = command.t
    record["estop_t"], record["estop_sequence"], record["estop_pressed"] = (estop.t, estop.sequence, estop.pressed)
    record["base_t"], record["stale"] = base.t, base.stale


def numbers(value: Any) -> Any:
    """Return a memory with arrays as lists, so that it can be compared."""
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype.names else value.tolist()
    if hasattr(value, "__dataclass_fields__"):
        return {name: numbers(getattr(value, name)) for name in value.__dataclass_fields__}
    return value


def test_it_does_what_the_gate_does_and_gives_its_memory_back() -> None:
    bench = Bench()
    stage, record = bench.activate(), new_shared()
    taken = bench.gate.memory
    for _ in range(500):
        inputs = bench.inputs()
        put(record, inputs)
        assert stage.stage.run(record) == ORDINARY
        result = bench.gate.step(inputs)
        assert numbers(command_of(record["command"][0], inputs.t)) == numbers(result.command)
    back = stage.give_back(taken)
    assert numbers(replace(back, request=bench.gate.memory.request)) == numbers(bench.gate.memory)


def changed(**fields: Any) -> Callable[[GateInputs], GateInputs]:
    """Return what replaces fields of one frame: state_q=..., command_kd=..., estop_pressed=..."""

    def change(inputs: GateInputs) -> GateInputs:
        for name, value in fields.items():
            frame, field = name.split("_", 1)
            old: Any = getattr(inputs, frame)
            if field in ("gyro", "acc", "quat"):
                value, field = replace(old.imu, **{field: value(getattr(old.imu, field))}), "imu"
            elif callable(value):
                value = value(getattr(old, field))
            inputs = replace(inputs, **{frame: replace(old, **{field: value})})
        return inputs

    return change


def joint(index: int, value: float) -> Callable[[Any], Any]:
    def put_value(array: Any) -> Any:
        out = array.copy()
        out[index] = value
        return out

    return put_value


ODD = {
    "no number": changed(state_q=joint(3, math.nan)),
    "a jump": changed(state_q=joint(14, 0.9)),
    "too fast": changed(state_dq=joint(20, 30.0)),
    "out of range": changed(state_q=lambda q: q + 0.09, state_dq=joint(3, 14.0)),
    "torque": changed(state_tau=joint(16, 500.0)),
    "tilted": changed(state_quat=lambda q: np.array([math.cos(0.45), math.sin(0.45), 0.0, 0.0])),
    "no quaternion": changed(state_quat=lambda q: 2.0 * q),
    "a rate that is none": changed(state_gyro=lambda g: g + 2e5),
    "an old state": changed(state_t=lambda t: t - 0.01),
    "a state from the future": changed(state_t=lambda t: t + 0.1),
    "pressed": changed(estop_pressed=True),
    "an e-stop frame from the future": changed(estop_t=lambda t: t + 0.1),
    "a command that is no number": changed(command_tau=joint(2, math.inf)),
    "a motor let go": changed(command_kd=joint(22, 0.0)),
    "stiffness below nothing": changed(command_kp=joint(5, -1.0)),
    "a command nobody means": changed(command_q=joint(13, 40.0)),
    "a jolt": changed(command_tau=joint(14, 30.0)),
    "a throw": changed(command_tau=lambda tau: tau + 400.0),
    "an old command": changed(command_t=lambda t: t - 0.01),
    "a command from the future": changed(command_t=lambda t: t + 0.1),
}


@pytest.mark.parametrize("odd", ODD)
def test_a_tick_that_is_not_ordinary_is_left_to_the_gate(odd: str) -> None:
    bench = Bench()
    stage, record = bench.activate(), new_shared()
    for _ in range(7):
        put(record, bench.inputs())
        assert stage.stage.run(record) == ORDINARY
    before = stage.stage.memory.tobytes()
    put(record, ODD[odd](bench.inputs()))
    sent = record["command"].copy()
    assert stage.stage.run(record) == UNUSUAL
    assert stage.stage.memory.tobytes() == before
    np.testing.assert_array_equal(record["command"], sent)


def at_rest(inputs: GateInputs, n: int) -> GateInputs:
    still = {"quat": lambda q: np.eye(4)[0], "gyro": lambda g: np.zeros(3), "acc": lambda a: np.full(3, 5.0)}
    return changed(**{f"state_{name}": value for name, value in still.items()})(inputs)


def powerless(inputs: GateInputs, n: int) -> GateInputs:
    return changed(state_tau=joint(17, 0.0), command_tau=joint(17, min(14.0, 0.5 * n)))(inputs)


LASTING = {
    "a pause": (lambda i, n: replace(i, t=i.t + 0.15), 1),
    "no e-stop frame": (lambda i, n: changed(estop_t=lambda t: t - 1.0)(i), 60),
    "a base that is stale": (lambda i, n: changed(base_stale=True)(i), 200),
    "sensors that stand still": (at_rest, 40),
    "gravity from a side": (lambda i, n: changed(state_acc=lambda a: np.array([9.81, 0.0, 0.0]))(i), 1500),
    "a speed that goes nowhere": (lambda i, n: changed(state_dq=joint(17, 0.9))(i), 300),
    "an IMU that turns in place": (lambda i, n: changed(state_gyro=lambda g: g + 0.29)(i), 1500),
    "a dead motor": (powerless, 300),
}


@pytest.mark.parametrize("what", LASTING)
def test_what_lasts_too_long_is_left_to_the_gate(what: str) -> None:
    """The stage goes on as long as the readable gate lets commands pass, and not one tick longer."""
    change, last = LASTING[what]
    bench = Bench()
    stage, record = bench.activate(), new_shared()
    for n in range(last):
        inputs = change(bench.inputs(), n)
        put(record, inputs)
        code = stage.stage.run(record)
        result = bench.gate.step(inputs)
        if code == UNUSUAL:
            assert result.state is not GateState.ACTIVE or result.memory.counters.strained, what
            return
        assert result.state is GateState.ACTIVE
        assert numbers(command_of(record["command"][0], inputs.t)) == numbers(result.command)
    pytest.fail(f"The stage never left the gate its tick: {what}.")


def test_legs_that_rest_in_the_hoist_are_ordinary() -> None:
    """Targets that stay the same are no fault where no foot carries."""
    bench = Bench()
    stage, record = bench.activate(), new_shared()
    rests = bench.gate.memory.command
    assert rests is not None
    for _ in range(500):
        inputs = changed(command_q=lambda q: np.concatenate((rests.q[LEGS], q[LEGS.stop :])))(bench.inputs())
        put(record, inputs)
        assert stage.stage.run(record) != UNUSUAL
        result = bench.gate.step(inputs)
        assert result.state is GateState.ACTIVE
        assert numbers(command_of(record["command"][0], inputs.t)) == numbers(result.command)


@pytest.mark.parametrize("mode", [GateState.INIT, GateState.ARMED, GateState.STOP1, GateState.STOP2])
def test_it_takes_over_from_an_active_gate_only(mode: GateState) -> None:
    bench = Bench()
    bench.activate()
    assert not GateStage(LIMITS).take(replace(bench.gate.memory, mode=mode))
    assert not GateStage(LIMITS).take(GateMemory())
