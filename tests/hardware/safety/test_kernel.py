"""The gate's compiled arithmetic is that of plain numpy, and its short cuts answer as the judges do."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from tests.hardware.safety.slow_gate import SlowLook, slow_limit

from golem.hardware.safety import gate as gate_module
from golem.hardware.safety import sender
from golem.hardware.safety.base import Counters, GateInputs, OperatorRequest, Outgoing, SafetyLimits
from golem.hardware.safety.gate import Gate
from golem.hardware.safety.limiter import limit_command
from golem.hardware.safety.memory import GateResult
from golem.hardware.safety.monitor import examine, quickly, whole
from golem.hardware.safety.senses import EVERY, SensesMemory, sense
from golem.interfaces.payloads import EstopMessage, GateState
from golem.types import Array, Imu, LowCommand, LowState

LIMITS = SafetyLimits.from_profile()
DT = 0.002
Rng = np.random.Generator


def any_state(rng: Rng, t: float, size: float) -> LowState:
    """A state whose numbers are about `size` times the limits, of a robot that leans by about as much."""
    u = size * rng.uniform(-1.0, 1.0, (3, 27))
    half = 0.5 * (LIMITS.state_upper - LIMITS.state_lower)
    quat = np.array([1.0, 0.0, 0.0, 0.0]) + 0.3 * size * rng.standard_normal(4)
    imu = Imu(quat / np.linalg.norm(quat), rng.standard_normal(3), 9.81 * rng.standard_normal(3))
    return LowState(t, LIMITS.middle + half * u[0], LIMITS.velocity * u[1], LIMITS.torque * u[2], imu)


def any_command(rng: Rng, t: float, size: float) -> LowCommand:
    u = size * rng.uniform(-1.0, 1.0, (5, 27))
    gains = 300.0 * np.abs(u[3]), 15.0 * np.abs(u[4])
    return LowCommand(t, 3.0 * u[0], LIMITS.velocity * u[1], LIMITS.torque * u[2], *gains)


@pytest.mark.parametrize("strained", [False, True])
@pytest.mark.parametrize("loaded", [False, True])
def test_the_limiter_is_that_of_numpy(strained: bool, loaded: bool) -> None:
    rng = np.random.default_rng(0)
    for k in range(1000):
        size = 10.0 ** rng.uniform(-2.0, 1.0)
        state, command = any_state(rng, 0.0, size), any_command(rng, 0.0, size)
        before = any_command(rng, 0.0, size)
        last = Outgoing(before.q, before.kp, before.kd, before.tau if loaded else None)
        dt = float(rng.choice([0.0, DT, 0.01]))
        sent, after = limit_command(1.0, state, command, LIMITS, last, dt, strained)
        expected, kept = slow_limit(state, command, LIMITS, last, dt, strained)
        for mine, other in zip((sent.q, sent.dq, sent.tau, sent.kp, sent.kd), expected, strict=True):
            np.testing.assert_array_equal(mine, other, err_msg=str(k))
        for name in ("q", "kp", "kd", "tau"):
            np.testing.assert_array_equal(getattr(after, name), getattr(kept, name))


def samples(rng: Rng, n: int) -> Iterator[LowState]:
    """States at every tick of a robot at work, some of whose parts repeat their numbers now and then."""
    q, old = np.zeros(27), any_state(rng, 0.0, 0.1)
    for k in range(n):
        new = any_state(rng, k * DT, 0.1)
        q = q + DT * new.dq
        arrays = {"q": q.copy(), "dq": new.dq, "tau": new.tau}
        still = slice(*sorted(rng.integers(0, 28, 2)))
        for name, array in arrays.items():
            if k // 10 % 2:
                array[still] = getattr(old, name)[still]
        old = LowState(new.t, **arrays, imu=new.imu if k // 7 % 2 else old.imu)
        yield old


def test_a_look_is_that_of_numpy() -> None:
    rng, memory, slow = np.random.default_rng(1), SensesMemory(), None
    looks, seen = 0, set[bool]()
    for k, state in enumerate(samples(rng, 3000)):
        sent = any_command(rng, 0.0, 0.3) if k // 400 % 2 else None
        before = memory.looked_at
        memory, believed, _ = sense(state, state.t, memory, LIMITS, sent)
        if not believed:
            continue
        slow = slow and slow.follow(state)
        if memory.looked is not state:
            continue
        if slow is None:
            slow = SlowLook.at(state)
            continue
        slow, looks = slow.add(state, state.t - before, sent, LIMITS), looks + 1
        np.testing.assert_allclose(memory.drift, slow.drift, rtol=0, atol=1e-15)
        np.testing.assert_allclose(memory.dead, slow.dead, rtol=0, atol=1e-15)
        np.testing.assert_allclose(memory.turn, slow.turn, rtol=0, atol=1e-14)
        assert memory.force is not None and slow.force is not None
        np.testing.assert_allclose(memory.force, slow.force, rtol=0, atol=1e-14)
        assert tuple(since < state.t for since in memory.since) == slow.same
        seen |= set(slow.same)
    assert looks > 500 and seen == {False, True} and 3000 // EVERY in (looks, looks + 1)


def test_what_is_quickly_known_of_a_state_is_what_the_judges_find() -> None:
    rng, known = np.random.default_rng(2), list[Counters]()
    for _ in range(4000):
        state = any_state(rng, 0.0, 10.0 ** rng.uniform(-1.0, 0.1))
        quick = quickly(state, state.q, LIMITS, LIMITS.jump)
        if quick is not None:
            assert whole(state)
            assert examine(state, LIMITS, Counters(position=2, torque=7)) == (quick, None)
            known.append(quick)
        assert quickly(state, state.q + 1.01 * LIMITS.jump, LIMITS, LIMITS.jump) is None
    assert {c.strained for c in known} == {False, True}


@pytest.mark.parametrize("name", ["q", "dq", "tau"])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e7])
def test_nothing_is_known_of_a_state_that_is_not_whole(name: str, value: float) -> None:
    state = any_state(np.random.default_rng(3), 0.0, 0.1)
    getattr(state, name)[26] = value
    assert quickly(state, np.zeros(27) + state.q[0], LIMITS, 1e9) is None


@pytest.mark.parametrize("name", ["quat", "gyro", "acc"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e7])
def test_nothing_is_known_of_an_imu_that_is_not_whole(name: str, value: float) -> None:
    state = any_state(np.random.default_rng(3), 0.0, 0.1)
    assert quickly(state, state.q, LIMITS, LIMITS.jump) is not None
    getattr(state.imu, name)[2] = value
    assert quickly(state, state.q, LIMITS, LIMITS.jump) is None


def numbers(result: GateResult) -> list[Array]:
    """Everything a result holds that is a number of a motor."""
    command, memory = result.command, result.memory
    arrays = [command.q, command.dq, command.tau, command.kp, command.kd]
    arrays += [memory.senses.drift, memory.senses.dead]
    return arrays


def episode(seed: int, ticks: int) -> Iterator[GateInputs]:
    """Frames of a robot that moves more or less, leans, jumps now and then, and gets strange commands."""
    rng = np.random.default_rng(seed)
    hard = 10.0 ** rng.uniform(-1.5, 0.3)
    rate, phase, swing = (rng.uniform(2.0, 20.0, 27), rng.uniform(0.0, 6.0, 27), 0.1 * hard * rng.uniform(0.0, 1.0, 27))
    for i in range(1, ticks):
        t = i * DT
        q, dq = swing * np.sin(rate * t + phase), swing * rate * np.cos(rate * t + phase)
        noise, lean = 1e-3 * rng.standard_normal((4, 27)), 0.5 * hard * np.sin(3.0 * t)
        quat = np.array([np.cos(0.5 * lean), np.sin(0.5 * lean), 0.0, 0.0])
        gyro, acc = (
            np.array([1.5 * hard * np.cos(3.0 * t), 0.0, 0.0]),
            9.81 * np.array([0.0, np.sin(lean), np.cos(lean)]),
        )
        if rng.random() < 0.01 * hard:
            q = q + 0.2 * (rng.random(27) < 0.1)
        tau = 20.0 * hard * rng.standard_normal(27)
        state = LowState(t, q + noise[0], dq + noise[1], tau, Imu(quat, gyro + noise[2, :3], acc + noise[3, :3]))
        far = 100.0 if rng.random() < 0.01 * hard else 1.0
        gains = np.abs(50.0 + 30.0 * noise[2] * 1e3), np.abs(2.0 + 0.5 * noise[3] * 1e3)
        command = LowCommand(t, far * (q + 10.0 * hard * noise[0]), dq, 3e3 * hard * noise[1], *gains)
        request = OperatorRequest.ACTIVATE if i > 20 else OperatorRequest.NONE
        yield GateInputs(t, state, command, EstopMessage(t, i, False), request)


def test_the_gate_decides_the_same_without_its_short_cuts(monkeypatch: pytest.MonkeyPatch) -> None:
    def results(seed: int) -> list[GateResult]:
        gate = Gate(LIMITS)
        return [gate.step(inputs) for inputs in episode(seed, 250)]

    quick = [results(seed) for seed in range(10)]
    monkeypatch.setattr(gate_module, "quickly", lambda *_: None)
    monkeypatch.setattr(sender, "_ordinary", lambda *_: False)
    states = set[GateState]()
    for seed, mine in enumerate(quick):
        for a, b in zip(mine, results(seed), strict=True):
            assert (a.state, a.reason, a.detail) == (b.state, b.reason, b.detail)
            assert a.memory.counters == b.memory.counters and a.memory.senses.bad == b.memory.senses.bad
            assert (a.memory.sender.jolts, a.memory.sender.refused) == (b.memory.sender.jolts, b.memory.sender.refused)
            for one, other in zip(numbers(a), numbers(b), strict=True):
                np.testing.assert_array_equal(one, other)
            states.add(a.state)
    assert {GateState.ACTIVE, GateState.STOP1} <= states


def test_a_prepared_gate_has_seen_nothing() -> None:
    gate = Gate(LIMITS)
    gate.prepare()
    assert gate.memory.state is None and gate.memory.mode is GateState.INIT
