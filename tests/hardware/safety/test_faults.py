"""Arbitrary faults in arbitrary order: whatever comes in, no command that goes out may break a limit."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from golem.hardware.safety.base import GateInputs, OperatorRequest, Outgoing, SafetyLimits
from golem.hardware.safety.gate import check
from golem.hardware.safety.memory import GateMemory, GateResult
from golem.interfaces.payloads import EstopMessage, GateState
from golem.types import Array, Imu, LowCommand, LowState

LIMITS = replace(
    SafetyLimits.from_profile().still(),
    **dict.fromkeys(("drift", "imu_drift", "gravity_angle", "dead_time", "jolts", "sinking", "lean"), np.inf),
    **dict.fromkeys(("capture", "opening"), (np.inf, np.inf)),
    least_kp=np.zeros(27),
    least_kd=np.full(27, 1e-9),
)
"""The states of these tests are noise: whether they are plausible is tested in `test_senses`."""
DT = 0.002
BAD = (np.nan, np.inf, -np.inf, 1e308, -1e308, 1e7, 50.0, -50.0, 0.0)
STATE_FIELDS = ("q", "dq", "tau")
COMMAND_FIELDS = ("q", "dq", "tau", "kp", "kd")
KINDS = (
    "sound", "sound", "sound", "corrupt_state", "corrupt_command", "corrupt_stamp", "corrupt_imu", "wrong_shape",
    "drop_state", "drop_command", "drop_estop", "old_state", "old_command", "old_estop", "far_target", "pressed",
    "clock_back", "clock_nan", "pause", "stop", "reset", "activate",
)  # fmt: skip


@dataclass(frozen=True)
class Event:
    """A kind of tick, repeated, with a seed for its details."""

    kind: str
    repeat: int
    seed: int


EVENTS = st.lists(
    st.builds(Event, st.sampled_from(KINDS), st.integers(1, 30), st.integers(0, 2**32 - 1)), min_size=1, max_size=25
)


class World:
    """Makes the inputs of one tick, sound ones from a robot that wanders, then spoiled as the event says."""

    def __init__(self) -> None:
        self.t = 0.0
        self.sequence = 0
        self.q = np.zeros(27)
        self.target = np.zeros(27)
        self.request = OperatorRequest.NONE
        self.past: deque[GateInputs] = deque(maxlen=100)

    def tick(self, kind: str, rng: np.random.Generator) -> GateInputs:
        self.t += DT
        self.sequence += 1
        self.q = np.clip(self.q + rng.normal(0.0, 0.002, 27), LIMITS.state_lower, LIMITS.state_upper)
        if kind == "far_target":
            legs = self.target[:12] + rng.uniform(-0.05, 0.05, 12)
            self.target = rng.uniform(LIMITS.lower - 1.0, LIMITS.upper + 1.0)
            self.target[:12] = legs
        imu = Imu(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 9.81]))
        state = LowState(self.t, self.q, rng.normal(0.0, 0.5, 27), rng.normal(0.0, 1.0, 27), imu)
        gains = (rng.uniform(0.0, 300.0, 27), rng.uniform(0.0, 10.0, 27))
        command = LowCommand(self.t, self.target, np.zeros(27), rng.normal(0.0, 5.0, 27), *gains)
        estop = EstopMessage(self.t, self.sequence % 256, kind == "pressed")
        self.request = {
            "stop": OperatorRequest.STOP,
            "reset": OperatorRequest.RESET,
            "activate": OperatorRequest.ACTIVATE,
        }.get(kind, OperatorRequest.NONE)
        sound = GateInputs(self.t, state, command, estop, self.request)
        self.past.append(sound)
        spoil: Callable[[GateInputs, np.random.Generator], GateInputs] = getattr(self, f"_{kind}", _keep)
        return spoil(sound, rng)

    def _corrupt_state(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        name = rng.choice(STATE_FIELDS)
        return replace(inputs, state=_corrupted(inputs.state, name, rng))

    def _corrupt_command(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        name = rng.choice(COMMAND_FIELDS)
        return replace(inputs, command=_corrupted(inputs.command, name, rng))

    def _corrupt_stamp(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        slot = str(rng.choice(("state", "command", "estop")))
        bad = float(rng.choice((np.nan, np.inf, -np.inf, 1e9, -1e9)))
        return replace(inputs, **{slot: replace(getattr(inputs, slot), t=bad)})

    def _corrupt_imu(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        assert inputs.state is not None
        quat = rng.normal(0.0, 1.0, 4) * rng.choice((0.0, 1.0, np.nan, np.inf))
        return replace(inputs, state=replace(inputs.state, imu=replace(inputs.state.imu, quat=quat)))

    def _wrong_shape(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        shape = [(26,), (28,), (27, 1), ()][rng.integers(4)]
        assert inputs.state is not None and inputs.command is not None
        if rng.integers(2):
            return replace(inputs, state=replace(inputs.state, q=np.zeros(shape)))
        return replace(inputs, command=replace(inputs.command, kp=np.zeros(shape)))

    def _drop_state(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, state=None)

    def _drop_command(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, command=None)

    def _drop_estop(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, estop=None)

    def _old_state(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, state=self._old(rng).state)

    def _old_command(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, command=self._old(rng).command)

    def _old_estop(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, estop=self._old(rng).estop)

    def _clock_back(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, t=inputs.t - float(rng.uniform(0.0, 10.0)))

    def _clock_nan(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        return replace(inputs, t=float(rng.choice((np.nan, np.inf, -np.inf))))

    def _pause(self, inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
        self.t += float(rng.uniform(0.0, 4.0))
        return replace(inputs, t=self.t)

    def _old(self, rng: np.random.Generator) -> GateInputs:
        return self.past[int(rng.integers(len(self.past)))]


def _keep(inputs: GateInputs, rng: np.random.Generator) -> GateInputs:
    return inputs


def _corrupted(frame: Any, name: str, rng: np.random.Generator) -> Any:
    array = np.array(getattr(frame, name))
    array[rng.integers(27)] = rng.choice(BAD)
    return replace(frame, **{name: array})


def torque(result: GateResult) -> Array:
    state, command = result.memory.state, result.command
    assert state is not None
    return command.kp * (command.q - state.q) + command.kd * (command.dq - state.dq) + command.tau


def assert_safe(result: GateResult, before: GateMemory) -> None:
    command, memory = result.command, result.memory
    for name in COMMAND_FIELDS:
        array = getattr(command, name)
        assert array.shape == (27,) and np.isfinite(array).all(), name
    assert np.isfinite(command.t)
    if result.state is not GateState.ACTIVE:
        assert not command.kp.any() and not command.tau.any() and not command.dq.any()
        assert np.all((command.kd >= 0.0) & (command.kd <= LIMITS.damping))
        return
    assert result.reason is None
    assert memory.state is not None and memory.command is not None and memory.estop is not None
    assert memory.t - memory.state.t <= LIMITS.state_age
    assert memory.t - memory.command.t <= LIMITS.command_age
    assert memory.t - memory.estop.t <= LIMITS.estop_age
    assert not memory.estop.pressed
    assert np.all(np.abs(torque(result)) <= LIMITS.torque_command * (1 + 1e-9) + 1e-9)
    assert np.all((command.kp >= 0.0) & (command.kp <= LIMITS.kp_max))
    assert np.all((command.kd >= 0.0) & (command.kd <= LIMITS.kd_max))
    if before.outgoing is None:
        return
    dt = min(memory.t - before.t, LIMITS.longest_tick)
    assert np.all(command.kp <= before.outgoing.kp + LIMITS.kp_rate * dt + 1e-9)
    moved = np.abs(command.q - before.outgoing.q)
    quick = moved > LIMITS.slew * dt * (1 + 1e-9) + 1e-12
    nearer = np.abs(command.q - memory.state.q) <= np.abs(before.outgoing.q - memory.state.q)
    assert np.all(nearer[quick])


@settings(max_examples=150)
@given(EVENTS)
def test_no_sequence_of_faults_lets_a_dangerous_command_out(events: list[Event]) -> None:
    world, memory, stopped = World(), GateMemory(), False
    for event in (Event("sound", 2, 0), Event("activate", 1, 0), Event("sound", 5, 0), *events):
        rng = np.random.default_rng(event.seed)
        for _ in range(event.repeat):
            inputs = world.tick(event.kind, rng)
            result = check(inputs, LIMITS, memory)
            assert_safe(result, memory)
            if stopped and result.state is GateState.ARMED:
                assert inputs.request is OperatorRequest.RESET
                stopped = False
            assert not (stopped and not result.state.stopped)
            stopped = result.state.stopped
            memory = result.memory


def test_the_fault_generator_does_reach_motion() -> None:
    world, memory = World(), GateMemory()
    rng = np.random.default_rng(0)
    states = []
    for kind in ("sound", "activate", *["far_target"] * 200, "pressed", "sound"):
        result = check(world.tick(kind, rng), LIMITS, memory)
        states.append(result.state)
        memory = result.memory
    assert states[0] is GateState.ARMED
    assert set(states[1:202]) == {GateState.ACTIVE}
    assert states[202:] == [GateState.STOP1, GateState.STOP1]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("most", [20_000, pytest.param(1_000_000, marks=pytest.mark.long)])
def test_random_states_and_commands_let_no_dangerous_command_out(most: int) -> None:
    rng, n, block = np.random.default_rng(1), 0, 1000
    active = 0
    limits = replace(LIMITS, jump=np.inf, throw=(np.inf, np.inf, np.inf))
    while n < most:
        # Anything from a robot at work to noise far beyond every limit, and commands that are finite or not.
        reach = 10.0 ** rng.uniform(-3.0, 1.0)
        states = reach * rng.standard_normal((block, 3, 27)) * [[[0.3], [3.0], [30.0]]]
        commands = rng.standard_normal((block, 5, 27)) * 10.0 ** rng.uniform(-2.0, 3.0, (block, 5, 1))
        commands[:, 3:] = np.abs(commands[:, 3:]) + 1e-3
        commands[rng.random((block, 5, 27)) < 1e-5] = np.nan
        world, memory = World(), GateMemory()
        for kind in ("sound", "activate"):
            memory = check(world.tick(kind, rng), limits, memory).memory
        for (q, dq, tau), command in zip(states, commands, strict=True):
            inputs = world.tick("sound", rng)
            assert inputs.state is not None and inputs.command is not None
            state = replace(inputs.state, q=q, dq=dq, tau=tau)
            result = check(replace(inputs, state=state, command=LowCommand(world.t, *command)), limits, memory)
            assert_safe(result, memory)
            active += result.state is GateState.ACTIVE
            memory, n = result.memory, n + 1
            if result.state is not GateState.ACTIVE:
                fresh = Outgoing(state.q, np.zeros(27), LIMITS.damping)
                memory = replace(memory, mode=GateState.ACTIVE, reason=None, detail="", outgoing=fresh)
    assert active > 1000
